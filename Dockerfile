# One image for every service; the command says which: router, gateway, estimator, record, dashboard, simulate.
# The virtual environment is made by the image's own python3, so that the build also runs on a plain Debian bookworm base.
FROM python:3.11-slim-bookworm AS build
RUN python3 -m venv /opt/gyrofree/venv
ENV PATH=/opt/gyrofree/venv/bin:$PATH PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1
WORKDIR /opt/gyrofree/src
COPY requirements/build.txt requirements/runtime.txt requirements/
RUN pip install --require-hashes -r requirements/build.txt -r requirements/runtime.txt
COPY pyproject.toml README.md LICENSE NOTICE ./
COPY firmware_protocol firmware_protocol
COPY messages messages
COPY gateway gateway
COPY inertial inertial
COPY estimator estimator
COPY logs logs
COPY sessions sessions
COPY dashboard dashboard
COPY emulator emulator
COPY gyrofree gyrofree
# Editable, as `make setup` does it: what runs is the folders above, with their templates and sub-packages.
RUN pip install --no-deps --no-build-isolation --editable .
# The filters are compiled here, so that a start takes no half minute; the cache knows the path of its source.
RUN NUMBA_CACHE_DIR=/opt/gyrofree/numba python -m estimator.warm

FROM python:3.11-slim-bookworm
RUN groupadd --gid 10001 gyrofree \
 && useradd --uid 10001 --gid 10001 --no-create-home --home-dir /nonexistent --shell /usr/sbin/nologin gyrofree \
 && install -d -o gyrofree -g gyrofree -m 0750 /data/journal /data/estimates /data/sessions /data/state \
 && install -d /etc/gyrofree
COPY --from=build /opt/gyrofree /opt/gyrofree
COPY --chmod=0755 deploy/entrypoint.sh /opt/gyrofree/entrypoint.sh
COPY --chmod=0644 deploy/gyrofree.toml /etc/gyrofree/gyrofree.toml
ENV PATH=/opt/gyrofree/venv/bin:$PATH PYTHONUNBUFFERED=1 PYTHONDONTWRITEBYTECODE=1 \
    NUMBA_CACHE_DIR=/tmp/numba HOME=/tmp MPLCONFIGDIR=/tmp
WORKDIR /etc/gyrofree
USER 10001:10001
ENTRYPOINT ["/opt/gyrofree/entrypoint.sh"]
CMD ["--help"]
