"""`gyrofree simulate`: the simulated table as a board on a line, and its truth on the bus.

Samples, pulses and GPS sentences go through the wire like those of any board; only the truth goes
straight to the bus, under its own topic, marked simulated. The wire does not wait for the bus. Each
run of the profile is a new boot of the board (same sensors, other noise), so that every estimator
starts over with it.
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
import zenoh

from gateway.virtual.board_link import PtyLink, TcpLink
from gateway.virtual.receiver import GPS_SIGMA, PLACE, sentences
from gateway.virtual.satellites import of_sky
from gateway.virtual.virtual_board import (
    SIMULATED,
    BoardAccel,
    BoardBytes,
    BoardPulse,
    Item,
    VirtualBoard,
)
from gyrofree.running.driven_table import TableDesk, until_it_ends
from inertial.simulation.arm import arm_test, centre
from inertial.simulation.driven import DrivenTable
from inertial.simulation.faults import AxisFault, Faults
from inertial.simulation.person import Person
from inertial.simulation.profiles import Profile
from inertial.simulation.table import BLOCK, TableTest, Truth
from messages.bus.session import BusSettings, LateSession, Publishers
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import TRUTH

log = logging.getLogger(__name__)

GPS_PERIOD = 1.0  # s
ARM_GPS_PERIOD, ARM_SIGMA_P, ARM_SIGMA_V = 0.5, 0.3, 0.1  # s, m, m/s: a better receiver, on the arm
FRAME_S = 0.01  # a board of more samples sends several in a frame; the truth is told as often


@dataclass(frozen=True)
class Options:
    """What `gyrofree simulate` was asked for."""

    link: Path | None
    tcp: int | None
    profile: str | Profile
    seed: int
    device: str
    once: bool
    faults: tuple[AxisFault, ...] = ()  # of single axes, in every run of the profile
    # the cube rides at the end of an arm of this length, with the receiver; 0: in the table's
    # centre
    arm_m: float = 0.0
    table_link: Path | None = None  # where the table's text protocol is offered
    table_tcp: int | None = None
    slips: int = 0  # of the person who turns a table that is not driven
    rate_hz: float = 100.0  # samples a second of the table's cube; of the arm always 100


class TruthPublisher:
    """Publishes the truth once the bus is there; until then truth has nobody to hear it."""

    def __init__(
        self, bus: BusSettings, device: str, source: int = pb.SOURCE_SIMULATED, every: int = 1
    ) -> None:
        """every: so many samples the truth is told once."""
        self._device, self._source, self._every = device, source, every
        self._epoch = 0
        self._publishers: Publishers | None = None
        self._session = LateSession(bus, lambda session: self._attach(session, bus.prefix))

    def _attach(self, session: zenoh.Session, prefix: str) -> None:
        self._publishers = Publishers(session, prefix)

    def close(self) -> None:
        """Leave the bus."""
        self._publishers = None
        self._session.close()

    def begin(self, epoch: int) -> None:
        """A new boot of the board."""
        self._epoch = epoch

    def put(self, index: int, t_s: float, truth: Truth) -> None:
        """Truth at sample `index`, t_s after boot."""
        if index % self._every:
            return
        self._put(
            pb.Truth(
                header=self._header(t_s),
                for_index=index,
                q_nb=truth.q_nb,
                omega_ib_b_radps=truth.omega_ib_b,
                alpha_b_radps2=truth.alpha_b,
                f_b_mps2=truth.f_b,
                angle_z_rad=truth.angle_z,
                profile_time_s=truth.profile_time_s,
            )
        )

    def tilt(
        self, index: int, t_s: float, q_nb: np.ndarray, f_b: np.ndarray, omega_b: np.ndarray
    ) -> None:
        """Attitude (4,), force (3,) and rate (3,) of a six-axis board at sample `index`, t_s after
        boot.
        """
        self._put(
            pb.Truth(
                header=self._header(t_s),
                for_index=index,
                q_nb=q_nb,
                f_b_mps2=f_b,
                omega_ib_b_radps=omega_b,
            )
        )

    def _header(self, t_s: float) -> pb.Header:
        return pb.Header(
            device=self._device,
            epoch=self._epoch,
            device_us=round(t_s * 1e6),
            utc_ns=time.time_ns(),
            source=self._source,
        )

    def _put(self, message: pb.Truth) -> None:
        if self._publishers is not None:
            self._publishers.put(TRUTH, self._device, message)


def _receiver(seed: int) -> Iterator[BoardBytes]:
    """One epoch per second, for ever."""
    draw = np.random.default_rng(
        [seed, 2, time.time_ns() & 0xFFFFFFFF]
    )  # the sky is another in each run
    for number in itertools.count():
        noise = draw.normal(0.0, 1.0, 3) * GPS_SIGMA
        utc = datetime.datetime.now(datetime.UTC)
        yield BoardBytes(number * GPS_PERIOD + 0.005, sentences(noise, utc) + of_sky(utc, PLACE))


def _rider(test: TableTest, seed: int) -> Iterator[BoardBytes]:
    """Two epochs a second of a receiver beside the cube at the end of the arm."""
    draw = np.random.default_rng([seed, 3, time.time_ns() & 0xFFFFFFFF])
    for number in itertools.count():
        t = number * ARM_GPS_PERIOD
        p, v = centre(test, t)
        p, v = p + draw.normal(size=3) * ARM_SIGMA_P, v + draw.normal(size=3) * ARM_SIGMA_V
        noise = np.array([p[0], p[1], -p[2]])
        utc = datetime.datetime.now(datetime.UTC)
        yield BoardBytes(t + 0.005, sentences(noise, utc, (v[0], v[1])) + of_sky(utc, PLACE))


def _table(
    test: TableTest, truths: TruthPublisher, faults: Faults, options: Options, desk: TableDesk
) -> Iterator[Item]:
    """Samples and pulses in time order; the truth leaves as its sample does. Once somebody takes
    the table over it does what it is told, and ends when it is given back.
    """
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
            if desk.remote and not options.arm_m:
                at = block.index + row, float(block.angle_z[row]), float(block.omega_b[row, 2])
                driven = DrivenTable(
                    seed=options.seed,
                    profile=test.profile,
                    run=test.run,
                    start=at,
                    rate_hz=options.rate_hz,
                )
                yield from desk.items(driven, truths, faults)
                return
            truths.put(block.index + row, t, block.truth(row))
            yield BoardAccel(t, tuple(block.counts[row].tolist()))
        for late in itertools.chain([pulse] if pulse else [], pulses):
            yield BoardPulse(late.t_s, late.direction)


def _test(options: Options, run: int) -> TableTest:
    if options.arm_m:
        return arm_test(options.seed, options.arm_m, run=run)
    return TableTest(seed=options.seed, profile=options.profile, run=run, rate_hz=options.rate_hz)


def _in_frame(test: TableTest) -> int:
    """Samples in one frame."""
    return max(1, round(FRAME_S / test.period_s))


def open_link(options: Options) -> tuple[PtyLink | TcpLink, str]:
    """The line, and its name for people; raises OSError for a path or port in use."""
    link = TcpLink(options.tcp) if options.tcp is not None else PtyLink(options.link)
    return link, str(options.link or link.path)


def run(options: Options, bus: BusSettings, stop: threading.Event) -> None:
    """Be the board until `stop` is set; raises ValueError for an unknown profile, OSError for a
    path or port in use.
    """
    test = _test(options, 0)  # before the link: an unknown profile is said at once
    link, port = open_link(options)
    truths = TruthPublisher(bus, options.device, every=_in_frame(test))
    person = Person(options.seed, options.slips)
    desk = TableDesk(_table_line(options), bus, options.device, person)
    log.info("simulated cube, profile %s, seed %d, on %s", test.profile.name, options.seed, port)
    first = int(time.time()) & 0xFF  # boot counters differ from those of the last process
    try:
        for run_number in itertools.count():
            test = _test(options, run_number)
            _one_run(test, link, truths, (first + run_number) & 0xFF, options, stop, desk)
            if options.once or stop.is_set():
                return
    finally:
        desk.close()
        truths.close()
        link.close()


def _table_line(options: Options) -> PtyLink | TcpLink | None:
    if options.table_tcp is not None:
        return TcpLink(options.table_tcp)
    return PtyLink(options.table_link) if options.table_link is not None else None


def _one_run(
    test: TableTest,
    link: PtyLink | TcpLink,
    truths: TruthPublisher,
    epoch: int,
    options: Options,
    stop: threading.Event,
    desk: TableDesk,
) -> None:
    """One test: the board boots on the still table, and the estimators begin as the published test
    did.
    """
    truths.begin(epoch)
    desk.begin()
    board = VirtualBoard(
        link,
        SIMULATED,
        epoch=epoch,
        sample_period_s=test.period_s,
        batch=_in_frame(test),
        firmware="simulated table",
    )
    table = _table(test, truths, Faults(options.faults), options, desk)
    receiver = _rider(test, options.seed) if options.arm_m else _receiver(options.seed)
    items = heapq.merge(table, receiver, key=lambda item: item.t_s)
    started = time.monotonic()
    board.run(
        until_it_ends(items, test.profile.seconds, desk),
        stop,
        wait_for_reader=True,
    )
    log.info(
        "run ended: %d samples, %d frames built, %d dropped",
        board.samples,
        board.built,
        board.dropped,
    )
    left = started + test.profile.seconds - time.monotonic()
    stop.wait(max(0.0, left) if board.samples and not desk.given_back else 0.0)
