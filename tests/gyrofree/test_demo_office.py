"""`gyrofree demo --office`: two places, real processes, and the line between them."""

import os
import re
import signal
import socket
import threading

import httpx
from support.stack import RunningDemo, free_port
from support.waiting import until

from gyrofree.demo.slow_line import SlowLine

LATE_S = 4.0
BYTES = os.urandom(60_000)


def free_run(count: int) -> int:
    """The first of so many ports that are free one after the other."""
    while True:
        first = free_port()
        try:
            for port in range(first, first + count):
                with socket.socket() as probe:
                    probe.bind(("127.0.0.1", port))
        except OSError:
            continue
        return first


def test_an_office_watches_and_its_cable_is_pulled_and_put_in_again(tmp_path):
    ports = free_run(2), free_run(3)
    with RunningDemo(tmp_path, "--office", ports=ports) as demo:
        link = re.search(r"open\s+(http://\S+)\s+\(office\)", demo.text())[1]
        url, _, token = link.partition("/login/link?token=")
        assert url.endswith(str(ports[0] + 1))
        with httpx.Client(base_url=url, headers={"origin": url}, timeout=60.0) as client:
            client.post("/login/link", data={"token": token})

            def age_s() -> float:
                found = client.get("/api/devices").json()
                late = found[0]["late"] if found else None
                return 1e9 if not late or late["age_s"] is None else late["age_s"]

            until(lambda: age_s() < LATE_S, "the lab's board at the office")
            demo.process.send_signal(signal.SIGUSR1)
            until(lambda: age_s() > LATE_S, "a picture that grows old")
            demo.process.send_signal(signal.SIGUSR1)
            until(lambda: age_s() < LATE_S, "a picture that is new again")
    assert "the cable between lab and office is pulled" in demo.text()
    assert "stopped cleanly" in demo.text()


def echo(listening: socket.socket) -> None:
    """Give one connection back what it sends."""
    link, _ = listening.accept()
    with link:
        while piece := link.recv(4096):
            link.sendall(piece)


def test_a_line_brings_every_byte_in_order_and_nothing_while_its_cable_is_out():
    with socket.create_server(("127.0.0.1", 0)) as listening:
        threading.Thread(target=echo, args=(listening,), daemon=True).start()
        port = free_port()
        line = SlowLine(port, listening.getsockname()[1], 8e6, 0.01)
        try:
            with socket.create_connection(("127.0.0.1", port), timeout=60.0) as link:
                threading.Thread(target=link.sendall, args=(BYTES,), daemon=True).start()
                got = b""
                while len(got) < len(BYTES) and (piece := link.recv(4096)):
                    got += piece
                assert got == BYTES
                assert line.out.carried == line.back.carried == len(BYTES)
                line.pulled = True
                link.sendall(b"later")
                link.settimeout(0.3)
                try:
                    assert not link.recv(5), "a byte through a cable that is out"
                except TimeoutError:
                    pass
                line.pulled = False
                link.settimeout(60.0)
                assert link.recv(5) == b"later"
        finally:
            line.close()
