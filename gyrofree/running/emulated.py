"""`gyrofree board --emulate`: the firmware image as a board on a line, its world the simulated
table.

The image runs in emulated time; this module lets that time follow the clock on the wall, `speed`
times as fast. The true motion goes to the bus under its own topic, for the very instants of the
samples that the image has sent.
"""

import datetime
import itertools
import logging
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from emulator.board import CCLK, Board
from emulator.world import Fault, World
from firmware_protocol.codec import Deframer, Frame
from firmware_protocol.frames import Acc12
from gateway.virtual.board_link import PtyLink, TcpLink
from gateway.virtual.receiver import GPS_SIGMA, sentences
from gyrofree.running.simulate import TruthPublisher
from inertial.simulation.table import TableTest
from messages.bus.session import BusSettings
from messages.contract import gyrofree_pb2 as pb

log = logging.getLogger(__name__)

IMAGE = Path("build/firmware/gyrofree.bin")
SLICE_S = 0.005  # s of emulated time between two looks at the line
GIVE_UP_S = 3.0  # s behind the wall clock: this machine is too slow, emulated time lets go of it
UTC0 = datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC)  # the receiver's time when power comes
ODR_TOLERANCE = 0.002  # one sigma of the sensors' own sampling clocks, of 1
NMEA_DELAY_S = 0.08  # from the pulse to the first sentence


@dataclass(frozen=True)
class Options:
    """What `gyrofree board` was asked for."""

    image: Path
    link: Path | None
    tcp: int | None
    profile: str
    seed: int
    speed: float
    clock_ppm: float
    faults: list[Fault] = field(default_factory=list)
    device: str = "cube"
    seconds: float = float("inf")


def table_world(test: TableTest, seed: int, clock_error: float = 0.0) -> World:
    """The simulated table as the board's sensors, tachometer and receiver meet it; the same for the
    same seed.
    """
    noise = [np.random.default_rng([seed, 3, sensor]) for sensor in range(4)]
    draw = np.random.default_rng([seed, 4])
    odr_error = tuple(ODR_TOLERANCE * draw.normal(0.0, 1.0, 4))

    def counts(sensor: int, t_s: np.ndarray) -> np.ndarray:
        felt = test.felt(np.maximum(t_s, 0.0), slice(3 * sensor, 3 * sensor + 3))
        return (felt + noise[sensor].normal(0.0, test.sensor.noise, felt.shape)) / test.sensor.count

    def pulses() -> Iterator[tuple[float, int]]:
        for second in itertools.count():
            for pulse in test.pulses(float(second), second + 1.0):
                yield pulse.t_s, pulse.direction
            yield second + 1.0, 0  # a table at rest must not be asked for ever

    def gnss() -> Iterator[tuple[float, bytes]]:
        sky = np.random.default_rng([seed, 5])
        for second in itertools.count(1):
            utc = UTC0 + datetime.timedelta(seconds=second)
            yield second + NMEA_DELAY_S, sentences(sky.normal(0.0, 1.0, 3) * GPS_SIGMA, utc)

    return World(
        counts=counts,
        pulses=pulses,
        pps=lambda: (float(second) for second in itertools.count(1)),
        gnss=gnss,
        odr_error=odr_error,
        phase=tuple(draw.uniform(0.0, 1.0, 4)),
        clock_error=clock_error,
    )


def world_time(board: Board, device_us: float) -> float:
    """World time of an instant on the image's clock, s: the image never stops or resets TIMER2
    after its start.
    """
    return (board.timer2.base_clock + device_us * (CCLK // 1_000_000)) / board.clocks_per_s


class TruthOfFrames:
    """Follows what the image sends, and publishes the truth for each sample of it."""

    def __init__(self, board: Board, test: TableTest, truths: TruthPublisher) -> None:
        self._board, self._test, self._truths = board, test, truths
        self._deframer = Deframer()
        self._epoch: int | None = None

    def take(self, data: bytes) -> None:
        """Bytes of the board's line."""
        for event in self._deframer.feed(data):
            if isinstance(event, Frame) and event.type == Acc12.TYPE:
                self._frame(event)

    def _frame(self, frame: Frame) -> None:
        if frame.epoch != self._epoch:
            self._epoch = frame.epoch
            self._truths.begin(frame.epoch)
        payload = frame.payload
        device_us = frame.t_us + np.arange(len(payload.counts)) * payload.period_ns / 1000.0
        times = np.array([world_time(self._board, us) for us in device_us])
        for k, truth in enumerate(self._test.truths(np.maximum(times, 0.0))):
            self._truths.put(payload.first_index + k, device_us[k] * 1e-6, truth)


def run(options: Options, bus: BusSettings, stop: threading.Event) -> None:
    """Be the board until `stop` is set. Raises ValueError for an unknown profile, EmulationError
    for a bad image.
    """
    test = TableTest(seed=options.seed, profile=options.profile)
    world = table_world(test, options.seed, options.clock_ppm * 1e-6)
    board = Board(options.image, world, options.faults)
    link = TcpLink(options.tcp) if options.tcp is not None else PtyLink(options.link)
    log.info(
        "emulated board, image %s, profile %s, seed %d, on %s",
        options.image,
        options.profile,
        options.seed,
        options.link or link.path,
    )
    truths = TruthPublisher(bus, options.device, pb.SOURCE_EMULATED)
    follower = TruthOfFrames(board, test, truths)
    try:
        while not link.connected and not stop.wait(0.02):
            pass  # power comes when somebody listens, so that the standstill at the start is seen
        _live(board, link, follower, options, stop)
    finally:
        truths.close()
        link.close()


def _live(
    board: Board,
    link: PtyLink | TcpLink,
    follower: TruthOfFrames,
    options: Options,
    stop: threading.Event,
) -> None:
    """Emulated time follows the wall's until `stop`."""
    began, said, resets = time.monotonic(), False, 0
    while not stop.is_set() and board.now_s < options.seconds:
        behind = (time.monotonic() - began) * options.speed - board.now_s
        if behind < SLICE_S:
            stop.wait((SLICE_S - behind) / options.speed)
            continue
        if behind > GIVE_UP_S * max(1.0, options.speed):
            began += (behind - SLICE_S) / options.speed
            if not said:
                log.warning(
                    "this machine cannot emulate the board %.3g times as fast as real time: it runs"
                    " slower",
                    options.speed,
                )
            said = True
        board.feed(link.read())
        data = board.run(board.now_s + SLICE_S)
        if data:
            link.write(data)
            follower.take(data)
        for at, why in board.resets[resets:]:
            log.warning("the board was reset at %.3f s: %s", at, why)
        resets = len(board.resets)
