# What the core is built with besides the compiler: Python's headers, nanobind and Eigen, all found in
# the Python environment that asks for the build.
if(ZIG)
  set(CMAKE_CXX_ARCHIVE_CREATE "\"${ZIG}\" ar qc <TARGET> <LINK_FLAGS> <OBJECTS>")
  set(CMAKE_CXX_ARCHIVE_FINISH "\"${ZIG}\" ranlib <TARGET>")
  set(CMAKE_SKIP_RPATH ON)
endif()

find_package(Python 3.11 REQUIRED COMPONENTS Interpreter Development.Module)
execute_process(
  COMMAND "${Python_EXECUTABLE}" -m nanobind --cmake_dir
  OUTPUT_STRIP_TRAILING_WHITESPACE OUTPUT_VARIABLE nanobind_ROOT COMMAND_ERROR_IS_FATAL ANY)
find_package(nanobind CONFIG REQUIRED)
# cmeel-eigen puts Eigen's headers below site-packages/cmeel.prefix
execute_process(
  COMMAND "${Python_EXECUTABLE}" -c
          "import cmeel, pathlib; print(pathlib.Path(cmeel.__path__[0]).parent / 'cmeel.prefix/include/eigen3')"
  OUTPUT_STRIP_TRAILING_WHITESPACE OUTPUT_VARIABLE EIGEN COMMAND_ERROR_IS_FATAL ANY)

# Debian's pyconfig.h includes <TRIPLET/python3.x/pyconfig.h>, which lies in /usr/include or, where the
# headers were unpacked elsewhere, beside them. A folder with that one name in it makes it found, and
# does not put the machine's C headers before those of another compiler.
get_filename_component(HEADERS "${Python_INCLUDE_DIRS}" DIRECTORY)
set(TRIPLET "${CMAKE_HOST_SYSTEM_PROCESSOR}-linux-gnu")
set(PYTHON_OF_TRIPLET "${CMAKE_BINARY_DIR}/headers")
if(EXISTS "${HEADERS}/${TRIPLET}")
  file(MAKE_DIRECTORY "${PYTHON_OF_TRIPLET}/${TRIPLET}")
  get_filename_component(version "${Python_INCLUDE_DIRS}" NAME)
  file(CREATE_LINK "${HEADERS}/${TRIPLET}/${version}" "${PYTHON_OF_TRIPLET}/${TRIPLET}/${version}" SYMBOLIC)
  include_directories(SYSTEM "${PYTHON_OF_TRIPLET}")
endif()
