# Part of compose-test.sh: the lab of compose.lab.yml and the office of compose.office.yml, linked.

lab() { GYROFREE_PORT=18081 podman-compose --project-name gyrofree-lab --file deploy/compose.lab.yml "$@"; }
office() { GYROFREE_PORT=18082 podman-compose --project-name gyrofree-office --file deploy/compose.office.yml "$@"; }
of() { podman ps --all --quiet --filter "label=com.docker.compose.project=gyrofree-$1" \
    --filter "label=com.docker.compose.service=$2"; }
at() { python3 -c "import urllib.request as u; u.urlopen('http://127.0.0.1:$1/api/health', timeout=3)"; }
sound() { timeout 30 podman healthcheck run "$(of "$1" "$2")"; }
hears() { # the office's own router has heard the lab's gateway
    timeout 60 podman exec "$(of office office)" gyrofree doctor --health gateway --config /data/site/gyrofree.toml
}
equal() { # a recording of the lab, at the office
    timeout 60 podman exec "$(of office office)" gyrofree site copies --config /data/site/gyrofree.toml | grep -q " equal "
}

clear_sites() {
    local place
    for place in lab office; do
        timeout 90 podman-compose --project-name "gyrofree-$place" --file "deploy/compose.$place.yml" down --volumes \
            --timeout 5 >/dev/null 2>&1 || true
    done
}

end_sites() {
    local code=$?
    trap - EXIT
    if [ $code != 0 ]; then
        for pair in "lab site" "lab bench" "lab board" "office office"; do
            printf -- '-- %s\n' "$pair"
            podman logs --tail 25 "$(of $pair)" 2>&1 || true
        done
        tail -20 "$STATE/join.log" 2>/dev/null || true
    fi
    rm -f deploy/secrets/invitation.txt
    clear_sites
    exit $code
}

prove_sites() {
    trap end_sites EXIT
    ip link set lo up
    ip address replace "$ADDRESS/32" dev lo
    clear_sites # of a run that was cut off
    local begun=$SECONDS
    lab up --detach --no-build >"$STATE/lab.log" 2>&1 || { cat "$STATE/lab.log"; die "podman-compose up of the lab"; }
    eventually 180 "the lab's page answers" at 18081
    mkdir -p deploy/secrets
    podman exec "$(of lab bench)" gyrofree site invite office --address "$ADDRESS" \
        --config /data/site/gyrofree.toml 2>/dev/null | tail -1 >deploy/secrets/invitation.txt
    chown 10001 deploy/secrets/invitation.txt
    chmod 0400 deploy/secrets/invitation.txt
    timeout 180 env GYROFREE_PORT=18082 podman-compose --project-name gyrofree-office --file deploy/compose.office.yml --profile by-hand \
        run --rm --service-ports join >"$STATE/join.log" 2>&1 || { cat "$STATE/join.log"; die "the office does not join"; }
    say "ok: the office joined by an invitation that is a secret's file"
    office up --detach --no-build >"$STATE/office.log" 2>&1 || { cat "$STATE/office.log"; die "podman-compose up of the office"; }
    eventually 180 "the office's page answers" at 18082
    eventually 90 "bench and office are healthy" eval 'sound lab bench && sound office office'
    eventually 90 "the office hears the lab's board" hears
    say "lab and office linked $((SECONDS - begun)) s after the first command"
    for pair in "lab bench" "lab board" "office office"; do
        [ "$(podman exec "$(of $pair)" id -u)" = 10001 ] || die "$pair runs as another user"
        refused podman exec "$(of $pair)" touch /etc/x /opt/gyrofree/x || die "$pair can write its root"
        podman exec "$(of $pair)" grep -q '^CapEff:[[:space:]]*0*$' /proc/1/status || die "$pair has capabilities"
    done
    say "ok: no root, read-only root, no capabilities in any of them"
    podman exec "$(of lab bench)" gyrofree backup /tmp/lab.zip --config /data/site/gyrofree.toml --only site \
        || die "no backup in the container"
    lab up --detach --no-build >>"$STATE/lab.log" 2>&1 || die "up a second time"
    eventually 120 "up a second time changes nothing" at 18081
    say "PASSED for lab and office with podman on a Debian stand-in base; not run under Docker Engine"
}
