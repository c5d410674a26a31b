"""`gyrofree simulate --board tilt`: an analogue tilt board in somebody's hand, on a line that
speaks the real wire.

While a guided detection of axes runs for its device, the hand does what the page says; else it
tilts the board about. Its wiring is drawn from the seed, so that there is something to find.
"""

import itertools
import logging
import threading
import time
from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from gateway.virtual.virtual_board import SIMULATED, BoardAdc, VirtualBoard
from gyrofree.running.simulate import Options, TruthPublisher, open_link
from inertial.simulation.hand import RATE_HZ, AnalogueWiring, Hand
from messages.bus.session import BusSettings, LateSession, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import WIRING

log = logging.getLogger(__name__)

CHANNELS = 7  # one of them open
REST_S, MOVE_S = 1.6, 1.4  # s, of a guided movement: the detection wants a second of rest
IDLE_REST_S, IDLE_MOVE_S = 1.0, 2.0
GONE_S = 3.0  # s of samples without a word: nobody guides any more
POSES = {
    pb.WiringStatus.POSE_LEVEL: "level",
    pb.WiringStatus.POSE_NOSE_UP: "nose up",
    pb.WiringStatus.POSE_RIGHT_DOWN: "right down",
    pb.WiringStatus.POSE_TURNED_RIGHT: "turned right",
}


class Guide:
    """What the page asks for, as heard on the bus; nothing while there is no bus or no
    detection.
    """

    def __init__(self, bus: BusSettings, device: str) -> None:
        self._wanted, self._samples_left = pb.WiringStatus(), 0.0
        self._session = LateSession(
            bus, lambda session: subscribe(session, WIRING, bus.prefix, self._heard, device)
        )

    def close(self) -> None:
        """Leave the bus."""
        self._session.close()

    def _heard(self, _: object, status: pb.WiringStatus) -> None:
        self._wanted, self._samples_left = status, GONE_S * RATE_HZ

    def pose(self) -> str:
        """Pose to go to now, asked once a sample; empty: whatever one likes."""
        self._samples_left -= 1.0
        if self._samples_left < 0.0:
            return ""
        status = self._wanted
        running = status.state in (pb.WiringStatus.STATE_WAITING, pb.WiringStatus.STATE_MOVING)
        return POSES[status.pose] if running else ""


def wiring_of(seed: int) -> AnalogueWiring:
    """A wiring of three accelerometers and three gyroscopes that is not the usual one."""
    draw = np.random.default_rng([seed, 41])
    inputs = tuple(int(v) for v in draw.permutation(CHANNELS)[:6])
    return AnalogueWiring(inputs, tuple(int(v) for v in draw.choice([-1, 1], 6)), CHANNELS)


def motion(hand: Hand, guide: Guide, seed: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Samples without end: guided where there is a guide."""
    draw, at, rest = np.random.default_rng([seed, 42]), "", 0.0
    while True:
        rest = rest + 1.0 / RATE_HZ if hand.resting else 0.0
        wanted = guide.pose()
        if wanted and rest > REST_S and wanted != at:
            hand.move_to(hand.pose(wanted), MOVE_S)
            at = wanted
        elif not wanted and rest > IDLE_REST_S:
            tilt = Rotation.from_euler("ZYX", draw.uniform(-1.0, 1.0, 3) * [0.5, 0.7, 0.9])
            hand.move_to(tilt, IDLE_MOVE_S)
            at = ""
        yield hand.step()


def run(options: Options, bus: BusSettings, stop: threading.Event) -> None:
    """Be the board until `stop` is set; raises OSError for a path or port in use."""
    link, port = open_link(options)
    wiring, hand = wiring_of(options.seed), Hand(options.seed)
    guide = Guide(bus, options.device)
    truths = TruthPublisher(bus, options.device)
    log.info("simulated tilt board, inputs %s, signs %s, on %s", wiring.inputs, wiring.signs, port)
    epoch = int(time.time()) & 0xFF
    truths.begin(epoch)

    def items() -> Iterator[BoardAdc]:
        samples = motion(hand, guide, options.seed)
        for k in itertools.count():
            f, w = next(samples)
            truths.tilt(k, k / RATE_HZ, hand.attitude.as_quat(canonical=True)[[3, 0, 1, 2]], f, w)
            yield BoardAdc(k / RATE_HZ, tuple(wiring.counts(f[None], w[None])[0].tolist()))

    try:
        board = VirtualBoard(link, SIMULATED, epoch=epoch, firmware="simulated tilt board")
        board.run(items(), stop, wait_for_reader=True)
    finally:
        guide.close()
        truths.close()
        link.close()
