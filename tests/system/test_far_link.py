"""The emulated link does what its figures say: a packet may come later than that, never sooner."""

import sys
import time

import pytest
from support.far_link import FarLink, Line, NoNamespaces, Place, far_link

ECHO = """
import socket
s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
s.bind(("10.77.0.2", 5000))
print("up", flush=True)
while True:
    data, peer = s.recvfrom(2000)
    s.sendto(data[:4], peer)
"""
# each question waits for its answer at most so long; prints how many came and how long all took
ASK = """
import socket, sys, time
count, size, patience = int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
s.settimeout(patience)
begin, came = time.monotonic(), 0
for number in range(count):
    wanted = number.to_bytes(4, "big")
    s.sendto(wanted + bytes(size - 4), ("10.77.0.2", 5000))
    try:
        while s.recv(100) != wanted:
            pass
        came += 1
    except TimeoutError:
        pass
print(came, time.monotonic() - begin)
"""
UDP = 28  # bytes of the headers of IP and UDP


@pytest.fixture(scope="module")
def link():
    try:
        with far_link(Line()) as made:
            echo = made.b.popen([sys.executable, "-P", "-c", ECHO], stdout=-1, text=True)
            assert echo.stdout.readline() == "up\n"
            yield made
            echo.kill()
            echo.wait()
    except NoNamespaces as error:
        pytest.skip(f"no network namespaces here: {error}")


def ask(place: Place, count: int, size: int = 100, patience_s: float = 30.0) -> tuple[int, float]:
    """How many of so many questions were answered, and how long it took."""
    words = [sys.executable, "-P", "-c", ASK, count, size, patience_s]
    came, seconds = place.run(words).stdout.split()
    return int(came), float(seconds)


def test_delay_and_rate(link: FarLink):
    link.line = Line(rate=200e3, delay_s=0.05)
    came, seconds = ask(link.a, 5, size=1000)
    assert came == 5
    assert seconds >= 5 * (0.1 + 8 * (1000 + UDP) / 200e3)


def test_what_does_not_fit_into_the_queue_is_dropped(link: FarLink):
    link.line = Line(rate=200e3, queue=500)
    before = link.there.full
    assert ask(link.a, 2, size=1000, patience_s=0.1)[0] == 0
    assert link.there.full == before + 2


def test_loss_is_counted_and_as_wanted(link: FarLink):
    link.line = Line(loss=0.3)
    carried, lost = link.there.carried, link.there.lost
    ask(link.a, 60, patience_s=0.02)
    end = time.monotonic() + 30.0
    while link.there.carried + link.there.lost < carried + lost + 60 and time.monotonic() < end:
        time.sleep(0.01)
    assert link.there.carried + link.there.lost == carried + lost + 60
    assert 2 <= link.there.lost - lost <= 40  # wanted 18, sigma 3.5


def test_nothing_passes_while_it_is_cut(link: FarLink):
    link.line = Line()
    link.cut()
    assert ask(link.a, 3, patience_s=0.05)[0] == 0
    assert link.there.cut >= 3
    link.mend()
    assert ask(link.a, 3)[0] == 3


def test_a_place_goes_when_its_link_does():
    try:
        with far_link(Line()) as link:
            place = link.a
            assert place.run(["ip", "-4", "-o", "addr"]).stdout.count("inet") == 2
    except NoNamespaces as error:
        pytest.skip(f"no network namespaces here: {error}")
    begin = time.monotonic()
    while place.run(["true"], check=False).returncode == 0 and time.monotonic() < begin + 10.0:
        pass
    assert place.run(["true"], check=False).returncode != 0
