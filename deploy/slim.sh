#!/bin/sh
# slim.sh VENV: take out of an environment what no service of an image uses. What services
# load is byte-compiled, since the image is read-only. Each line says why it may go.
set -eu
cd "$1"
packages=$(echo "$PWD"/lib/python3*/site-packages)

# installers: nothing is installed in a container
rm -rf "$packages"/pip "$packages"/pip-* "$packages"/setuptools* "$packages"/pkg_resources "$packages"/_distutils_hack \
  "$packages"/distutils-precedence.pth bin/pip*
# makers of documentation, asked for by numpydoc, which allantools names and does not import
rm -rf "$packages"/sphinx "$packages"/sphinxcontrib "$packages"/babel "$packages"/alabaster "$packages"/numpydoc \
  "$packages"/docutils "$packages"/snowballstemmer
# Arrow's servers, clouds, headers and second copies of a library: tables are written to files
rm -rf "$packages"/pyarrow/libarrow_flight* "$packages"/pyarrow/_flight* "$packages"/pyarrow/libarrow_s3* \
  "$packages"/pyarrow/include "$packages"/pyarrow/src \
  "$packages"/pyarrow/libarrow_python*.so "$packages"/pyarrow/*.so.*.*.*
# the source that viser's page was built from; the page itself is client/build
rm -rf "$packages"/viser/client/src
# tests of packages
find "$packages" -type d -name tests -prune -exec rm -rf {} +
# names for debuggers: a hundred megabytes. Libraries in *.libs were patched when their wheels were made, which
# strip takes for damage and then makes damage of.
find "$packages" \( -name '*.so' -o -name '*.so.[0-9]*' \) -type f -not -path '*.libs/*' -exec strip --strip-unneeded {} +
find "$packages" \( -name '*.pyi' -o -name '*.pyx' -o -name '*.pxd' \) -delete

# What is left must still load, and what is loaded here is byte-compiled by that. All of it would be 80 MB.
bin/python -c 'import gateway.service, estimator.service, dashboard.service, dashboard.scene.service, logs
import allantools, matplotlib.pyplot, pyarrow.csv, pyarrow.parquet, reportlab.platypus, scipy.io, scipy.stats, scipy.signal'
cd "$packages"
"$OLDPWD"/bin/python -m compileall -q firmware_protocol messages gateway inertial estimator logs sessions dashboard gyrofree
