# One image for every service; the command says which: router, gateway, estimator, record, dashboard, simulate.
# The virtual environment is made by the image's own python3, so that the build also runs on a plain Debian bookworm base.
FROM python:3.11-slim-bookworm AS wheel
WORKDIR /src
COPY requirements/build.txt requirements/compiler.txt requirements/native.sh requirements/
RUN mkdir .make && python3 -m venv .venv \
 && .venv/bin/pip install --no-cache-dir --no-deps --require-hashes -r requirements/build.txt \
 && sh requirements/native.sh
COPY pyproject.toml README.md LICENSE NOTICE ./
COPY firmware_protocol firmware_protocol
COPY messages messages
COPY gateway gateway
COPY inertial inertial
COPY estimator estimator
COPY logs logs
COPY sessions sessions
COPY dashboard dashboard
COPY sites sites
COPY emulator emulator
COPY gyrofree gyrofree
RUN PATH=/src/.venv/bin:$PATH CXX="$(cat .make/compiler)" .venv/bin/pip wheel --no-deps --no-build-isolation \
    --config-settings=cmake.define.Python_INCLUDE_DIR="$(cat .make/headers)" --wheel-dir dist .

FROM python:3.11-slim-bookworm AS packages
RUN apt-get update && apt-get install -y --no-install-recommends binutils
COPY requirements/runtime.txt requirements/
RUN python3 -m venv /opt/gyrofree/venv \
 && /opt/gyrofree/venv/bin/pip install --no-cache-dir --no-deps --no-compile --require-hashes -r requirements/runtime.txt
COPY --from=wheel /src/dist dist
COPY deploy/slim.sh deploy/
RUN /opt/gyrofree/venv/bin/pip install --no-cache-dir --no-deps --no-compile --no-index dist/*.whl \
 && sh deploy/slim.sh /opt/gyrofree/venv

FROM python:3.11-slim-bookworm
RUN groupadd --gid 10001 gyrofree \
 && useradd --uid 10001 --gid 10001 --no-create-home --home-dir /nonexistent --shell /usr/sbin/nologin gyrofree \
 && install -d -o gyrofree -g gyrofree -m 0750 /data/journal /data/estimates /data/sessions /data/state /data/procedures /data/site \
 && install -d /etc/gyrofree
COPY --from=packages /opt/gyrofree /opt/gyrofree
COPY --chmod=0644 deploy/gyrofree.toml /etc/gyrofree/gyrofree.toml
ENV PATH=/opt/gyrofree/venv/bin:$PATH PYTHONUNBUFFERED=1 PYTHONDONTWRITEBYTECODE=1 \
    HOME=/tmp MPLCONFIGDIR=/tmp
WORKDIR /etc/gyrofree
USER 10001:10001
ENTRYPOINT ["gyrofree"]
CMD ["--help"]
