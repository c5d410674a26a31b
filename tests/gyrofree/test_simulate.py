"""The simulated board on its line: what it sends is the wire, and a run is a boot."""

import datetime
import threading

import numpy as np
from pynmeagps import NMEAReader
from support.wire import Wire

from firmware_protocol.codec import FLAG_SIMULATED, Deframer, Frame
from firmware_protocol.frames import Acc12, Gps, Hello, Tacho
from gateway.virtual import receiver
from gyrofree.running import simulate
from messages.bus.session import BusSettings


def run_at_once(monkeypatch, profile, **options):
    """The frames of one run, without waiting for real time."""
    wire = Wire()
    monkeypatch.setattr(simulate, "PtyLink", lambda link: wire)
    monkeypatch.setattr(wire, "path", "wire", raising=False)
    real = simulate.VirtualBoard.run
    monkeypatch.setattr(
        simulate.VirtualBoard, "run", lambda *a, **k: real(*a, **(k | {"speed": 1e6}))
    )
    stop = threading.Event()
    monkeypatch.setattr(stop, "wait", lambda timeout=None: stop.is_set())
    nobody = BusSettings(router="tcp/127.0.0.1:1")
    simulate.run(simulate.Options(None, None, profile, 1, "cube", True, **options), nobody, stop)
    stop.set()
    frames = Deframer().feed(bytes(wire.data))
    assert all(isinstance(frame, Frame) for frame in frames)
    return frames


def test_a_quick_board_sends_all_its_samples_in_frames_of_ten(monkeypatch):
    told = []
    monkeypatch.setattr(
        simulate.TruthPublisher, "_put", lambda self, message: told.append(message.for_index)
    )
    frames = run_at_once(monkeypatch, "published", rate_hz=1000.0)
    samples = [frame.payload for frame in frames if isinstance(frame.payload, Acc12)]
    assert [sample.first_index for sample in samples] == list(range(0, 30_000, 10))
    assert {len(sample.counts) for sample in samples} == {10}
    assert {sample.period_ns for sample in samples} == {1_000_000}
    assert told[:3000] == list(range(0, 30_000, 10))  # the next is ready, and not sent


def test_a_run_is_one_boot_of_thirty_seconds(monkeypatch):
    frames = run_at_once(monkeypatch, "published")
    payloads = [frame.payload for frame in frames]
    assert isinstance(payloads[0], Hello)
    samples = [payload for payload in payloads if isinstance(payload, Acc12)]
    assert [sample.first_index for sample in samples] == list(range(3000))
    assert len({frame.epoch for frame in frames}) == 1
    assert all(frame.flags & FLAG_SIMULATED for frame in frames)
    assert [frame.seq for frame in frames] == list(range(len(frames)))
    pulses = sum(len(payload.offsets_10ns) for payload in payloads if isinstance(payload, Tacho))
    turned = 171 * (8 + 1)  # deg each way: the plateau and two ramps of 1 s that each count half
    assert abs(pulses - 2 * turned) <= 4
    text = b"".join(payload.data for payload in payloads if isinstance(payload, Gps))
    assert text.count(b"$GPGGA") == 30


def test_the_receiver_stands_where_it_says():
    utc = datetime.datetime(2026, 3, 1, 23, 59, 59, tzinfo=datetime.UTC)
    lines = receiver.sentences(np.array([3.0, -4.0, 1.0]), utc).splitlines(keepends=True)
    gga, _gst, rmc = (NMEAReader.parse(line) for line in lines)
    north = (gga.lat - receiver.PLACE[0]) * receiver.METRES_PER_DEGREE
    east = (gga.lon - receiver.PLACE[1]) * receiver.METRES_PER_DEGREE * np.cos(np.radians(gga.lat))
    assert abs(north - 3.0) < 0.05
    assert abs(east + 4.0) < 0.05
    assert abs(gga.alt + gga.sep - receiver.PLACE[2] - 1.0) < 0.02
    assert str(rmc.date) == "2026-03-01"
