"""The simulated tilt board: its frames through gateway and pipeline, guided until its wiring is
found and used.
"""

import numpy as np
import pytest
from support.wire import Wire

from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from gateway.board.device import DeviceLink
from gateway.ports.reader import Chunk
from gateway.settings import DeviceSettings, GatewaySettings
from gateway.virtual.virtual_board import SIMULATED, BoardAdc, VirtualBoard
from gyrofree.running.simulate_hand import CHANNELS, Guide, motion, wiring_of
from inertial.rotation import to_matrix
from inertial.simulation.hand import RATE_HZ, Hand
from messages.bus.session import BusSettings
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ADC, ATTITUDE, IMU, WIRING
from messages.history.journal_file import BOARD

SEED = 4


class Bench:
    """Hand, board, line, gateway and pipeline, without a bus between them."""

    def __init__(self, folder):
        self.guide = Guide(BusSettings(router="tcp/127.0.0.1:1"), "tilt-board")
        self.guide.close()
        self.hand, self.wiring = Hand(SEED), wiring_of(SEED)
        self.samples = motion(self.hand, self.guide, SEED)
        self.board = VirtualBoard(Wire(), SIMULATED, epoch=1, batch=5)
        device = DeviceSettings(name="tilt-board", port="file:///dev/null")
        self.link = DeviceLink(
            device, GatewaySettings(journal=folder / "journal", devices=[device])
        )
        self.heard = []
        self.link.out.direct(lambda topic, name, message: self.heard.append((topic, message)))
        self.pipeline = Pipeline(
            EstimatorSettings(navigators=[], attitudes=["vqf"], axes=folder / "axes")
        )
        self.k, self.truth = 0, []

    def run(self, seconds, until=lambda status: False):
        """Go on; outputs of the pipeline. Ends when a status says so."""
        out = []
        for _ in range(round(seconds * RATE_HZ / 5)):
            for _ in range(5):
                f, w = next(self.samples)
                self.truth.append(self.hand.attitude.as_matrix())
                counts = self.wiring.counts(f[None], w[None])[0].tolist()
                self.board.take(BoardAdc(self.k / RATE_HZ, tuple(counts)))
                self.k += 1
            data, self.board.link.data = bytes(self.board.link.data), bytearray()
            self.link.take(Chunk(BOARD, data, 1_000_000_000 + self.k * 10_000_000))
            said = [
                o
                for topic, m in self.heard
                if topic in (ADC, IMU)
                for o in self.pipeline.on(topic, m)
            ]
            self.heard.clear()
            out += said
            for o in said:
                if o.topic is WIRING:
                    self.guide._heard("", o.message)
                    if until(o.message):
                        return out
        return out

    def order(self, action):
        reply, out = self.pipeline.order(pb.EstimatorCommand(action=action, device="tilt-board"))
        for o in out:
            self.guide._heard("", o.message)
        return reply

    def error(self, outputs):
        """RMS angle between the vertical of the estimates and the true one, degrees."""
        angles = [
            np.arccos(
                np.clip(
                    to_matrix(np.array(o.message.q_nb))[2] @ self.truth[o.message.for_index][2],
                    -1.0,
                    1.0,
                )
            )
            for o in outputs
            if o.topic is ATTITUDE
        ]
        assert len(angles) > 100
        return np.degrees(np.sqrt(np.mean(np.square(angles))))


@pytest.fixture
def bench(tmp_path):
    one = Bench(tmp_path)
    yield one
    one.link.journal.close()
    one.link.spool.close()


def test_the_hand_follows_the_guide_until_the_wiring_is_found_and_the_tilt_is_right(bench):
    before = bench.error(bench.run(6.0))
    assert bench.order(pb.EstimatorCommand.ACTION_WIRING_START).ok
    said = bench.run(90.0, until=lambda status: status.state == pb.WiringStatus.STATE_FOUND)
    last = [o.message for o in said if o.topic is WIRING][-1]
    assert last.complete, last.instruction
    found = {entry.axis: entry.name for entry in last.inputs if entry.axis}
    axes = ("force x", "force y", "force z", "rate y", "rate x", "rate z")
    assert found == {
        axis: f"input {channel}" for axis, channel in zip(axes, bench.wiring.inputs, strict=True)
    }
    assert len(last.inputs) == CHANNELS
    assert bench.order(pb.EstimatorCommand.ACTION_WIRING_SAVE).ok
    bench.run(5.0)
    after = bench.error(bench.run(10.0))
    assert after < 3.0 < 20.0 < before


def test_the_board_says_what_it_is(bench):
    bench.run(0.2)
    adc = bench.pipeline._axes._batch("tilt-board", "adc")
    assert adc.channels == CHANNELS and adc.channel_mask == 2**CHANNELS - 1
    assert adc.accel_v_per_mps2 == pytest.approx(0.4785 / 9.80665)
