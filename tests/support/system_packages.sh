#!/bin/sh
# Debian packages that the tests need, installed (as root) or named. Debian 12 and 13; elsewhere: the programs of the same names.
# With the word compilers also what `make compilers` needs.
set -eu

missing=""
need() { command -v "$1" >/dev/null 2>&1 || missing="$missing $2"; }

need chromium "chromium fonts-dejavu-core"
need g++ "g++ libc6-dev"
need git git
need arm-none-eabi-gcc gcc-arm-none-eabi
need qemu-system-arm qemu-system-arm
if [ "${1:-}" = compilers ]; then
  need aarch64-linux-gnu-g++ g++-aarch64-linux-gnu
  need qemu-aarch64 qemu-user
fi
need clang-tidy clang-tidy
need cppcheck cppcheck

# The fuzzer's library is a package of clang's version: 14 in Debian 12, 19 in Debian 13.
fuzzer='int LLVMFuzzerTestOneInput(const unsigned char *d, unsigned long n); int LLVMFuzzerTestOneInput(const unsigned char *d, unsigned long n) { return d && n ? 0 : 0; }'
out=$(mktemp)
clang_is_missing=0
echo "$fuzzer" | clang -x c -fsanitize=fuzzer,address,undefined - -o "$out" 2>/dev/null || clang_is_missing=1
rm -f "$out"

[ -n "$missing" ] || [ "$clang_is_missing" = 1 ] || exit 0
if [ "$(id -u)" = 0 ]; then
  apt-get update -q
elif [ "$clang_is_missing" = 0 ]; then
  echo "The tests need Debian packages; run: sudo apt-get install$missing"
  exit 1
fi
if [ "$clang_is_missing" = 1 ]; then
  version=$(apt-cache depends clang | sed -n 's/.*Depends: clang-\([0-9]*\)$/\1/p' | head -1)
  missing="$missing clang libclang-rt-${version:-14}-dev"
fi
if [ "$(id -u)" != 0 ]; then
  echo "The tests need Debian packages; run: sudo apt-get install$missing"
  exit 1
fi
# shellcheck disable=SC2086 # one word per package
apt-get install -y -q --no-install-recommends $missing
