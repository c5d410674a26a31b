#!/bin/sh
# What the core is built with, beside the packages of build.txt: a C++20 compiler and Python's headers. Where
# the machine lacks them they are brought into .venv, without root: the package ziglang, and Debian's headers
# unpacked. Writes the compiler's name to .make/compiler and the headers' folder to .make/headers.
set -eu
python=.venv/bin/python

compiles() {
  printf '#include <concepts>\nint f() { return 0; }\n' |
    "$1" -std=c++20 -fPIC -shared -x c++ - -o .make/trial.so 2>/dev/null && rm -f .make/trial.so
}

compiler=${CXX:-}
for name in c++ g++ clang++; do
  if [ -z "$compiler" ] && compiles "$name"; then compiler=$name; fi
done
if [ -z "$compiler" ]; then
  echo "No C++20 compiler found on this machine: installing one into .venv (100 MB, once) ..."
  $python -m pip --disable-pip-version-check install --quiet --no-deps --require-hashes -r requirements/compiler.txt
  compiler=zig
fi
echo "$compiler" > .make/compiler

headers=$($python -c 'import sysconfig; print(sysconfig.get_path("include"))')
if [ ! -e "$headers/Python.h" ]; then
  version=$(basename "$headers") # python3.11
  if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    apt-get update -q && apt-get install -y -q --no-install-recommends "lib$version-dev"
  else
    echo "Python's headers are missing on this machine: unpacking Debian's into .venv ..."
    if ! (cd .make && apt-get download -q "lib$version-dev" && dpkg-deb -x "lib$version-dev"_*.deb ../.venv/headers); then
      echo "Python's headers (Python.h) are needed; run: sudo apt-get install python3-dev (elsewhere: python3-devel)"
      exit 1
    fi
    rm -f .make/"lib$version-dev"_*.deb
    headers=$PWD/.venv/headers/usr/include/$version
  fi
fi
echo "$headers" > .make/headers
