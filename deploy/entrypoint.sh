#!/bin/sh
# numba wants to write beside what it reads, the image is read-only: the compiled filters go to the tmpfs first.
set -eu
if [ ! -d "$NUMBA_CACHE_DIR" ]; then
    cp -r /opt/gyrofree/numba "$NUMBA_CACHE_DIR"
fi
exec gyrofree "$@"
