# The compiler: the one named in CXX, or the machine's, or the one of the PyPI package `ziglang` where
# the machine has none (or CXX=zig). Included before project(); Python_EXECUTABLE has to be known.
find_program(MACHINE_COMPILER NAMES c++ g++ clang++)
if("$ENV{CXX}" STREQUAL "zig" OR NOT (CMAKE_CXX_COMPILER OR DEFINED ENV{CXX} OR MACHINE_COMPILER))
  execute_process(
    COMMAND "${Python_EXECUTABLE}" -c
            "import pathlib, ziglang; print(pathlib.Path(ziglang.__path__[0]) / 'zig')"
    OUTPUT_STRIP_TRAILING_WHITESPACE OUTPUT_VARIABLE ZIG RESULT_VARIABLE failed ERROR_QUIET)
  if(failed)
    message(FATAL_ERROR "No C++ compiler found: c++, g++ or clang++ (C++20) is wanted. "
                        "Install g++ 12 or newer, or the package ziglang beside this Python.")
  endif()
  # Named by target, so that it compiles for any processor of the kind, not for the one it runs on.
  cmake_host_system_information(RESULT PROCESSOR QUERY OS_PLATFORM)
  set(CMAKE_CXX_COMPILER "${ZIG}" c++ -target ${PROCESSOR}-linux-gnu)
  set(CMAKE_C_COMPILER "${ZIG}" cc -target ${PROCESSOR}-linux-gnu)
endif()
