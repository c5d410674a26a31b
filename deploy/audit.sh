#!/bin/sh
# Asks what is known of vulnerabilities in the packages of requirements/runtime.txt: `make audit`.
# Ends with 0 only where somebody answered and knew of none.
set -eu
cd "$(dirname "$0")/.."
mkdir -p build
rm -f build/audit.json
code=0
"$1" --strict --require-hashes --disable-pip --progress-spinner off --format json --output build/audit.json \
    --requirement requirements/runtime.txt 2>build/audit.log || code=$?
cat build/audit.log >&2
if [ ! -s build/audit.json ]; then
    echo "audit: no source of advisories answered: nothing is known of vulnerabilities, neither good nor bad" >&2
    exit 2
fi
[ "$code" = 0 ] || echo "audit: see build/audit.json" >&2
exit "$code"
