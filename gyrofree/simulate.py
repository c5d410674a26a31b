"""`gyrofree simulate`: the simulated table as a board on a line, and its truth on the bus.

Samples, pulses and GPS sentences go through the wire like those of any board; only the truth goes straight to the bus,
under its own topic, marked simulated. The wire does not wait for the bus. Each run of the profile is a new boot of the
board (same sensors, other noise), so that every estimator starts over with it.
"""

import datetime
import heapq
import itertools
import logging
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pynmeagps import GET, NMEAMessage

from estimator.simulation.faults import AxisFault, Faults
from estimator.simulation.table import BLOCK, TableTest, Truth
from gateway.board_link import PtyLink, TcpLink
from gateway.virtual_board import SIMULATED, BoardAccel, BoardBytes, BoardPulse, Item, VirtualBoard
from messages import gyrofree_pb2 as pb
from messages.bus import BusSettings, BusUnavailable, Publishers, open_client
from messages.topics import TRUTH

log = logging.getLogger(__name__)

PLACE = (37.759, 45.978, 1468.0)  # deg, deg, m above the ellipsoid: where the published test was made, roughly
GEOID = 17.0  # m, ellipsoid above mean sea level there, rounded
GPS_SIGMA = (0.8, 0.8, 1.6)  # m, north, east, up, white: a receiver at rest
GPS_PERIOD = 1.0  # s
METRES_PER_DEGREE = 111_195.0  # m of latitude


@dataclass(frozen=True)
class Options:
    """What `gyrofree simulate` was asked for."""

    link: Path | None
    tcp: int | None
    profile: str
    seed: int
    device: str
    once: bool
    faults: tuple[AxisFault, ...] = ()  # of single axes, in every run of the profile


class TruthPublisher:
    """Publishes the truth once the bus is there; until then truth has nobody to hear it."""

    def __init__(
        self, bus: BusSettings, device: str, stop: threading.Event, source: int = pb.SOURCE_SIMULATED
    ) -> None:
        self._device, self._source = device, source
        self._epoch = 0
        self._publishers: Publishers | None = None
        threading.Thread(target=self._connect, args=(bus, stop), name="truth", daemon=True).start()

    def _connect(self, bus: BusSettings, stop: threading.Event) -> None:
        try:
            self._session = open_client(bus, stop)
        except BusUnavailable:
            return
        self._publishers = Publishers(self._session, bus.prefix)

    def begin(self, epoch: int) -> None:
        """A new boot of the board."""
        self._epoch = epoch

    def put(self, index: int, t_s: float, truth: Truth) -> None:
        """Truth at sample `index`, t_s after boot."""
        if self._publishers is None:
            return
        header = pb.Header(
            device=self._device,
            epoch=self._epoch,
            device_us=round(t_s * 1e6),
            utc_ns=time.time_ns(),
            source=self._source,
        )
        message = pb.Truth(
            header=header,
            for_index=index,
            q_nb=truth.q_nb,
            omega_ib_b_radps=truth.omega_ib_b,
            alpha_b_radps2=truth.alpha_b,
            f_b_mps2=truth.f_b,
            angle_z_rad=truth.angle_z,
            profile_time_s=truth.profile_time_s,
        )
        self._publishers.put(TRUTH, self._device, message)


def sentences(place_noise: np.ndarray, utc: datetime.datetime) -> bytes:
    """GGA, GST and RMC of a receiver at PLACE plus place_noise (3,), m north, east, up."""
    lat = PLACE[0] + place_noise[0] / METRES_PER_DEGREE
    lon = PLACE[1] + place_noise[1] / (METRES_PER_DEGREE * np.cos(np.radians(PLACE[0])))
    clock, day = utc.time(), utc.date()
    gga = NMEAMessage(
        "GP", "GGA", GET, time=clock, lat=lat, NS="N", lon=lon, EW="E", quality=1, numSV=9, HDOP=0.9,
        alt=round(PLACE[2] + place_noise[2] - GEOID, 2), altUnit="M", sep=GEOID, sepUnit="M",
    )  # fmt: skip
    north, east, up = GPS_SIGMA
    gst = NMEAMessage(
        "GP", "GST", GET, time=clock, rangeRms=1.0, stdMajor=east, stdMinor=north, orient=0.0,
        stdLat=north, stdLong=east, stdAlt=up,
    )  # fmt: skip
    rmc = NMEAMessage(
        "GP", "RMC", GET, time=clock, status="A", lat=lat, NS="N", lon=lon, EW="E", spd=0.0, cog=0.0, date=day,
        posMode="A",
    )  # fmt: skip
    return gga.serialize() + gst.serialize() + rmc.serialize()


def _receiver(seed: int) -> Iterator[BoardBytes]:
    """One epoch per second, for ever."""
    draw = np.random.default_rng([seed, 2, time.time_ns() & 0xFFFFFFFF])  # the sky is another in each run
    for number in itertools.count():
        noise = draw.normal(0.0, 1.0, 3) * GPS_SIGMA
        yield BoardBytes(number * GPS_PERIOD + 0.005, sentences(noise, datetime.datetime.now(datetime.UTC)))


def _table(test: TableTest, truths: TruthPublisher, faults: Faults) -> Iterator[Item]:
    """Samples and pulses in time order; the truth leaves as its sample does."""
    for number in itertools.count():
        block = faults.into(test.block(number))
        end = block.t_s[-1] + test.period_s
        pulses = iter(test.pulses(float(block.t_s[0]), float(end)))
        pulse = next(pulses, None)
        for row in range(BLOCK):
            t = float(block.t_s[row])
            while pulse is not None and pulse.t_s <= t:
                yield BoardPulse(pulse.t_s, pulse.direction)
                pulse = next(pulses, None)
            truths.put(block.index + row, t, block.truth(row))
            yield BoardAccel(t, tuple(block.counts[row].tolist()))
        for late in itertools.chain([pulse] if pulse else [], pulses):
            yield BoardPulse(late.t_s, late.direction)


def run(options: Options, bus: BusSettings, stop: threading.Event) -> None:
    """Be the board until `stop` is set; raises ValueError for an unknown profile, OSError for a path or port in use."""
    test = TableTest(seed=options.seed, profile=options.profile)  # before the link: an unknown profile is said at once
    link = TcpLink(options.tcp) if options.tcp is not None else PtyLink(options.link)
    truths = TruthPublisher(bus, options.device, stop)
    port = str(options.link or link.path)
    log.info("simulated cube, profile %s, seed %d, on %s", options.profile, options.seed, port)
    first = int(time.time()) & 0xFF  # boot counters differ from those of the last process
    try:
        for run_number in itertools.count():
            test = TableTest(seed=options.seed, profile=options.profile, run=run_number)
            _one_run(test, link, truths, (first + run_number) & 0xFF, options, stop)
            if options.once or stop.is_set():
                return
    finally:
        link.close()


def _one_run(
    test: TableTest,
    link: PtyLink | TcpLink,
    truths: TruthPublisher,
    epoch: int,
    options: Options,
    stop: threading.Event,
) -> None:
    """One test: the board boots on the still table, and the estimators begin as the published test did."""
    truths.begin(epoch)
    board = VirtualBoard(link, SIMULATED, epoch=epoch, firmware="simulated table")
    table = _table(test, truths, Faults(options.faults))
    items = heapq.merge(table, _receiver(options.seed), key=lambda item: item.t_s)
    started = time.monotonic()
    board.run(itertools.takewhile(lambda item: item.t_s < test.profile.seconds, items), stop, wait_for_reader=True)
    log.info("run ended: %d samples, %d frames built, %d dropped", board.samples, board.built, board.dropped)
    stop.wait(max(0.0, started + test.profile.seconds - time.monotonic()) if board.samples else 0.0)
