"""A receiver on a line of its own that says absurd things under right checksums: pty, gateway, real
bus. Nothing ends, each refusal is counted by name, what is missing does not become 0.
"""

import math
import random
import threading
import time

import pytest
from support.receivers import at, frame, gga, mutated, nav_pvt, random_message, rmc, sentence
from support.waiting import until

from gateway.virtual.board_link import PtyLink
from messages.contract.checks import check
from tests.gateway.test_service import bench, dark_bench  # noqa: F401
from tests.support.hostile_frames import good

T0 = 1718366400
REFUSED = {
    "GGA latitude": gga(at(1), lat="9100.0000"),
    "GGA longitude": gga(at(1), lon="18100.0000"),
    "GGA altitude": gga(at(1), alt="1000000000"),
    "GGA satellites": gga(at(1), n="255"),
    "GGA time of day": gga("246161"),
    "GGA HDOP": gga(at(1)).replace(",0.9,", ",-0.9,"),
    "GST sigma": "GPGST,120001.00,,,,,-1.5,2.5,4.5",
    "RMC speed": rmc(at(1), spd="1000000"),
    "RMC course": rmc(at(1), cog="NaN"),
    "RMC date": rmc(at(1), d="300299"),
    "NAV-PVT latitude": nav_pvt(T0, lat=91.0),
    "NAV-PVT longitude": nav_pvt(T0, lon=181.0),
    "NAV-PVT velocity": nav_pvt(T0, v=(1e6, 0.0, 0.0)),
    "NAV-PVT length": nav_pvt(T0, size=60),
    "NAV-PVT date": nav_pvt(T0, month=13),
    "NAV-POSLLH length": frame(1, 2, b"\x00" * 12),
}
EMPTY = "GPGGA,120009.00,,,,,0,,,,,,,,"
NO_FIX = {
    "gnssFixOK is 0": nav_pvt(T0 + 1, flags=0),
    "a time alone": nav_pvt(T0 + 2, fix=5),
    "invalidLlh": nav_pvt(T0 + 3, lat=0.0, lon=0.0, flags3=1),
    "no fix": nav_pvt(T0 + 4, fix=0, flags=0, lat=0.0, lon=0.0, h_acc=0xFFFFFFFF),
}


def as_bytes(message: str | bytes) -> bytes:
    return message if isinstance(message, bytes) else sentence(message)


class Receiver:
    """A pty of its own beside that of a board that goes on."""

    def __init__(self, bench) -> None:  # noqa: F811
        self.bench, self.board, self.line = bench, PtyLink(), PtyLink()
        bench.gateway(self.board.path, gnss_port=self.line.path)
        self._stop, self._sent = threading.Event(), 0
        self._running = threading.Thread(target=self._board)
        self._running.start()
        until(lambda: bench.seen["accel"])

    def _board(self) -> None:
        while not self._stop.is_set():
            self.board.write(good(self._sent, self._sent))
            self._sent += 1
            time.sleep(0.01)

    def say(self, *messages: str | bytes) -> None:
        """As fast as the line takes them."""
        for message in messages:
            self.line.write(as_bytes(message))

    def fixes(self, talker: str) -> list:
        return [m for m in list(self.bench.seen["gnss"]) if m.talker == talker]

    def close(self) -> None:
        self._stop.set()
        self._running.join(10)
        self.board.close()
        self.line.close()


@pytest.fixture
def receiver(bench):  # noqa: F811
    one = Receiver(bench)
    yield one
    one.close()


def test_absurd_fields_are_counted_by_name_and_the_next_fix_is_whole(receiver):
    receiver.say(*REFUSED.values(), gga(at(5), talker="GA"), gga(at(6), talker="GB"))
    whole = until(lambda: receiver.fixes("GA"))[0]
    assert whole.latitude_deg == pytest.approx(49.44033333) and whole.quality == 1
    wanted = {f"receiver: {name}" for name in REFUSED}
    status = receiver.bench.status(lambda s: wanted <= set(s.refused))
    assert all(status.refused[name] == 1 for name in wanted), status.refused
    said = receiver.bench.status(lambda s: "refused in the last seconds" in s.message)
    assert sum(n in said.message for n in REFUSED) >= 3


def test_what_a_receiver_does_not_know_is_never_0(receiver):
    receiver.say(EMPTY, EMPTY.replace("120009", "120010"))
    until(lambda: receiver.fixes("GP"))
    flat = {"fix": 2, "v_acc": 0xFFFFFFFF}
    receiver.say(*NO_FIX.values(), *(nav_pvt(T0 + k, **flat) for k in (9, 10)))
    flying = until(lambda: [m for m in receiver.fixes("UBX") if m.quality])[0]
    assert math.isnan(flying.height_m) and math.isnan(flying.v_n_mps[2])
    place = until(lambda: receiver.bench.seen["location"])[0]
    assert place.latitude == flying.latitude_deg and math.isnan(place.altitude)
    silent = [m for m in list(receiver.bench.seen["gnss"]) if not m.quality]
    assert len(silent) >= 1 + len(NO_FIX)
    for message in silent:
        assert math.isnan(message.latitude_deg) and math.isnan(message.height_m)
        assert not message.v_n_mps and not message.position_sigma_ned_m


def test_a_receiver_is_never_exact(receiver):
    """Accuracies of 0 are said by receivers that have none yet."""
    receiver.say(
        *(gga(at(1), talker="GA"), "GAGST,120001.00,,,,,0.0,0.0,0.0", gga(at(2), talker="GA")),
        *(nav_pvt(T0 + k, h_acc=0, v_acc=0, s_acc=0) for k in (1, 2)),
        frame(1, 0x36, b"\x00" * 4 + b"\x00\x01\x01" + b"\x00" * 57),
        *(nav_pvt(T0 + 3, v_acc=0), nav_pvt(T0 + 4)),
    )
    by_nmea = until(lambda: receiver.fixes("GA"))[0]
    assert list(by_nmea.position_sigma_ned_m) == pytest.approx([1.6, 1.6, 3.2])
    exact, _, half = until(lambda: len(f := receiver.fixes("UBX")) >= 3 and f)[:3]
    assert exact.quality and not exact.position_sigma_ned_m
    assert list(exact.v_n_mps) == pytest.approx([0.2, 6.3, 0.0])
    assert not exact.velocity_sigma_ned_mps
    assert half.position_sigma_ned_m[0] > 1.0 and math.isnan(half.position_sigma_ned_m[2])


def test_anything_at_all_ends_nothing(receiver):
    draw = random.Random(11)
    receiver.say(*(random_message(draw) if k % 2 else mutated(draw) for k in range(1500)))
    receiver.say(b"\r\n", *(gga(at(3000 + k), talker="QZ") for k in range(9)))
    until(lambda: receiver.fixes("QZ"))
    before = len(receiver.bench.seen["accel"])
    until(lambda: len(receiver.bench.seen["accel"]) > before)
    status = receiver.bench.status(lambda s: sum("receiver" in n for n in s.refused) > 20)
    assert status.connected and check(status) == []
    assert all(check(m) == [] for m in list(receiver.bench.seen["gnss"]))
