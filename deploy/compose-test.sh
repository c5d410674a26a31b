#!/usr/bin/env bash
# Build the image and run docker-compose.yml with podman, where there is no Docker Engine; say what was proven.
#
# For root on Debian 12. The base image is a stand-in made by mmdebstrap under the name that the Dockerfile asks for.
# Everything lives below $GYROFREE_COMPOSE_STATE (default /var/tmp/gyrofree-compose; the base image is kept there) and in
# mount and network namespaces of its own, so that no firewall rule and no mount of the machine is touched.
set -euo pipefail
cd "$(dirname "$(readlink -f "$0")")/.."
STATE=${GYROFREE_COMPOSE_STATE:-/var/tmp/gyrofree-compose}
BASE=docker.io/library/python:3.11-slim-bookworm
PROJECT=gyrofree-test
ADDRESS=10.99.0.1 # an address of the "outside" during the run
export CONTAINERS_CONF=$STATE/containers.conf CONTAINERS_STORAGE_CONF=$STATE/storage.conf
export GYROFREE_PORT=18080

say() { printf '== %s\n' "$*"; }
die() { printf 'compose-test: %s\n' "$*" >&2; exit 1; }

packages() {
    local missing=() pair
    for pair in podman:podman crun:crun catatonit:catatonit mmdebstrap:mmdebstrap iptables:iptables ip:iproute2; do
        command -v "${pair%%:*}" >/dev/null || missing+=("${pair##*:}")
    done
    for pair in netavark aardvark-dns; do
        [ -x "/usr/lib/podman/$pair" ] || missing+=("$pair")
    done
    [ ${#missing[@]} = 0 ] || { say "installing ${missing[*]}"; apt-get update -q; \
        DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "${missing[@]}"; }
    PATH=$PWD/.venv/bin:$PATH
    command -v podman-compose >/dev/null || die "podman-compose is not there: make dev"
}

configure() {
    mkdir -p "$STATE"
    cat >"$CONTAINERS_CONF" <<CONF
[containers]
default_ulimits = ["nofile=4096:4096", "nproc=4096:4096"]
cgroups = "disabled"
init_path = "$(command -v catatonit)"
[engine]
cgroup_manager = "cgroupfs"
events_logger = "file"
runtime = "crun"
[network]
network_backend = "netavark"
network_config_dir = "$STATE/networks"
CONF
    cat >"$CONTAINERS_STORAGE_CONF" <<CONF
[storage]
driver = "overlay"
graphroot = "$STATE/graph"
runroot = "$STATE/run"
CONF
    # What pip on this machine needs to reach its packages: given to the build only, never to the image.
    BUILD_MOUNTS=()
    python3 - "$STATE/pip.conf" >"$STATE/mounts" <<'PY'
import os, subprocess, sys
values = {}
listed = subprocess.run([sys.executable, "-m", "pip", "config", "list"], capture_output=True, text=True).stdout
for line in listed.splitlines():
    name, _, value = line.partition("=")
    values[name.rpartition(".")[2]] = value.strip("'\"")
if "cert" not in values and os.environ.get("SSL_CERT_FILE"):
    values["cert"] = os.environ["SSL_CERT_FILE"]
with open(sys.argv[1], "w") as stream:
    stream.write("[global]\n" + "".join(f"{name} = {value}\n" for name, value in values.items()))
for name in ("cert", "find-links"):
    path = values.get(name, "")
    if os.path.exists(path):
        print(os.path.realpath(path) + ":" + path)
PY
    local line
    while read -r line; do BUILD_MOUNTS+=(--volume "$line:ro"); done <"$STATE/mounts"
    BUILD_MOUNTS+=(--volume "$STATE/pip.conf:/etc/pip.conf:ro")
}

base_image() {
    podman image exists "$BASE" && return
    say "making the stand-in base image with mmdebstrap, without manuals as slim images are"
    mmdebstrap --quiet --variant=minbase --include=python3,python3-venv,ca-certificates,libstdc++6 \
        --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt='path-exclude=/usr/share/man/*' \
        --dpkgopt='path-exclude=/usr/share/locale/*' --dpkgopt='path-exclude=/usr/share/info/*' \
        bookworm "$STATE/rootfs.tar"
    podman import --quiet "$STATE/rootfs.tar" "$BASE" >/dev/null
    rm -f "$STATE/rootfs.tar"
}

build() {
    say "building"
    timeout 2400 podman build --quiet --format docker --network host --isolation chroot --pull=never \
        "${BUILD_MOUNTS[@]}" --tag localhost/gyrofree:local .
    podman image inspect --format 'image: {{.Size}} bytes' localhost/gyrofree:local
}

compose() { podman-compose --project-name "$PROJECT" --file docker-compose.yml "$@"; }
container() { podman ps --all --quiet --filter "label=com.docker.compose.project=$PROJECT" \
    --filter "label=com.docker.compose.service=$1"; }
inside() { local service=$1; shift; timeout 60 podman exec "$(container "$service")" "$@"; }

eventually() { # seconds, what, command...
    local end=$((SECONDS + $1)) what=$2
    shift 2
    until "$@" >/dev/null 2>&1; do
        [ $SECONDS -lt $end ] || die "$what: not within the time given"
        sleep 1
    done
    say "ok: $what"
}
refused() { ! "$@" >/dev/null 2>&1; }
page() { python3 -c "import urllib.request as u; u.urlopen('http://127.0.0.1:$GYROFREE_PORT/api/health', timeout=3)"; }
healthy() { timeout 30 podman healthcheck run "$(container "$1")"; }
reaches() { inside "$1" python3 -c "import socket; socket.create_connection(('$ADDRESS', 9999), 3)"; }
session_state() { inside recorder gyrofree replay --list --json | grep -q "\"state\": \"$1\""; }

# The published test from start to report: the procedures drive the table of another container, the recorder records it.
signed_report() {
    local begun=$SECONDS
    timeout 300 podman exec "$(container dashboard)" gyrofree procedure run published-30s --unit SN-1 --operator ann \
        --out /tmp/report >"$STATE/procedure.log" 2>&1 || { cat "$STATE/procedure.log"; die "the published test"; }
    inside dashboard grep -q "SN-1" /tmp/report/report.html || die "the report does not name the unit"
    say "ok: the published test was run to its report in $((SECONDS - begun)) s: $(tail -1 "$STATE/procedure.log")"
}

finish() {
    local code=$?
    trap - EXIT
    if [ $code != 0 ]; then
        for service in router gateway board estimator recorder procedures alarms dashboard; do
            printf -- '-- %s\n' "$service"
            podman logs --tail 15 "$(container "$service")" 2>&1 || true
        done
    fi
    [ -z "${OUTSIDE:-}" ] || kill "$OUTSIDE" 2>/dev/null || true
    timeout 90 podman-compose --project-name "$PROJECT" --file docker-compose.yml down --volumes --timeout 5 \
        >/dev/null 2>&1 || true
    exit $code
}

# "inside" is for this script's own use: by hand it would unmount the machine's cgroups and change its addresses.
own_namespace() {
    [ "$(readlink "/proc/self/ns/$1")" != "$(readlink "/proc/1/ns/$1")" ] \
        || die "inside: this is the machine's own $1 namespace; run deploy/compose-test.sh without arguments"
}

prove() {
    trap finish EXIT
    ip link set lo up
    ip address add "$ADDRESS/32" dev lo
    python3 -m http.server --bind "$ADDRESS" 9999 >/dev/null 2>&1 &
    OUTSIDE=$!
    local begun=$SECONDS service
    compose up --detach --no-build >"$STATE/up.log" 2>&1 || { cat "$STATE/up.log"; die "podman-compose up"; }
    eventually 120 "the dashboard answers on its published port" page
    for service in router gateway estimator recorder procedures alarms dashboard; do
        eventually 90 "$service is healthy" healthy "$service"
    done
    say "all healthy after $((SECONDS - begun)) s"
    for service in router gateway board estimator recorder procedures alarms dashboard; do
        [ "$(inside "$service" id -u)" = 10001 ] || die "$service runs as another user"
        refused inside "$service" touch /etc/gyrofree/x /opt/gyrofree/x || die "$service can write its root"
        inside "$service" grep -q '^CapEff:[[:space:]]*0*$' /proc/1/status || die "$service has capabilities"
    done
    say "ok: no root, read-only root, no capabilities in any of them"
    [ "$(podman port --all | wc -l)" = 1 ] || die "published: $(podman port --all)"
    say "ok: one published port: $(podman port --all)"
    reaches dashboard || die "the dashboard's network has no way out: the next check would prove nothing"
    for service in router gateway estimator recorder procedures; do
        refused reaches "$service" || die "$service can reach the outside"
    done
    say "ok: router, gateway, estimator, recorder and procedures cannot reach the outside, which the dashboard's network can"
    signed_report
    kill -KILL "$(podman inspect --format '{{.State.Pid}}' "$(container recorder)")"
    eventually 60 "a killed recorder is started again and recovers the session" session_state recovered
    eventually 60 "it records again" session_state open
    timeout 60 podman-compose --project-name "$PROJECT" --file docker-compose.yml stop --timeout 8 recorder >/dev/null 2>&1
    eventually 30 "an orderly stop ends with exit code 0" \
        test "$(podman inspect --format '{{.State.ExitCode}}' "$(container recorder)")" = 0
    say "PASSED with podman $(podman --version | cut -d' ' -f3) on a Debian stand-in base; not run under Docker Engine"
}

source deploy/compose-sites.sh

[ "$(id -u)" = 0 ] || die "must run as root (namespaces, mmdebstrap)"
packages
if [ "${1:-}" != inside ]; then
    # Podman sees a version 2 cgroup tree beside version 1 and takes the wrong one: hide it from this process only.
    exec unshare --mount -- "$0" inside
fi
own_namespace mnt
if [ "${2:-}" != run ]; then
    ! mountpoint -q /sys/fs/cgroup/unified || umount /sys/fs/cgroup/unified
    configure
    base_image
    build
    exec unshare --net -- "$0" inside run
fi
own_namespace net
case "${GYROFREE_COMPOSE_WHAT:-all}" in # one: docker-compose.yml; sites: lab and office; none: the image only
    all) (prove) && prove_sites ;;
    one) prove ;;
    sites) prove_sites ;;
esac
