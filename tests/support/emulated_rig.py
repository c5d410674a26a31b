"""Image, gateway and estimator in one thread and in emulated time: nothing depends on how fast the
machine is.
"""

from collections import defaultdict
from pathlib import Path

import numpy as np

from emulator.board import Board
from emulator.world import World, parse_fault
from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from gateway.board.device import DeviceLink
from gateway.ports.reader import Chunk
from gateway.settings import DeviceSettings, GatewaySettings
from gyrofree.running.emulated import table_world, world_time
from inertial.simulation.table import TableTest
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, BY_NAME
from messages.history.journal_file import BOARD

SLICE_S = 0.01


class HostPort:
    """What a gateway has of an open port: it writes into the board's receiver."""

    connected, message, reconnects, silent_s = True, "", 0, 0.0

    def __init__(self, board: Board) -> None:
        self._board = board

    def write(self, data: bytes) -> None:
        self._board.feed(data)


class Rig:
    """A powered board whose bytes reach the gateway's link at the emulated time they leave."""

    def __init__(
        self,
        image: Path,
        folder: Path,
        world: World | None = None,
        faults: tuple[str, ...] = (),
        test: TableTest | None = None,
        rate: list[str] | None = None,
        slice_s: float = SLICE_S,
    ) -> None:
        """slice_s: how finely the times of receipt are told, s."""
        self.test, self._slice_s = test, slice_s
        world = world or (table_world(test, 1) if test is not None else World())
        self.board = Board(image, world, [parse_fault(text) for text in faults])
        settings = GatewaySettings(
            devices=[DeviceSettings(name="cube", port="emulated")], journal=folder / "journal"
        )
        self.link = DeviceLink(settings.devices[0], settings)
        self.link.readers = [HostPort(self.board)]
        self.link.out.direct(lambda topic, device, message: self._published(topic.name, message))
        self.pipeline = Pipeline(EstimatorSettings(rate=rate)) if rate else None
        self.seen: dict[str, list] = defaultdict(list)
        self.wire = bytearray()
        self._second = 0.0

    def _published(self, name: str, message) -> None:
        self.seen[name].append(message)
        if self.pipeline is not None and BY_NAME[name] is ACCEL:
            for output in self.pipeline.on(ACCEL, message):
                self.seen[output.topic.name].append(output.message)

    @property
    def now_ns(self) -> int:
        return int(self.board.now_s * 1e9) + 1

    def run(self, until_s: float) -> None:
        """Let everybody live until this time."""
        while until_s - self.board.now_s > 1e-7:  # a clock is 10 ns
            data = self.board.run(min(self.board.now_s + self._slice_s, until_s))
            if data:
                self.wire += data
                self.link.take(Chunk(BOARD, data, self.now_ns))
            self.link.orders.step(self.board.now_s)
            if self.board.now_s - self._second >= 1.0:
                self._second = self.board.now_s
                self.link.watch.look(True, self.now_ns)

    def order(self, name: str, value: int = 0, ask: bool = False, wait_s: float = 5.0) -> pb.Reply:
        """Order something and live until it is answered."""
        answer = self.link.order(pb.BoardCommand(name=name, value=value, ask=ask))
        end = self.board.now_s + wait_s
        while not answer.done() and self.board.now_s < end:
            self.run(self.board.now_s + SLICE_S)
        return answer.result(timeout=0)

    def faults(self) -> dict[str, pb.Fault]:
        """Every fault ever told, as last told."""
        return {fault.name: fault for info in self.seen["board"] for fault in info.faults}

    def rate_error(self, estimator: str, since_s: float = 0.0) -> np.ndarray:
        """RMS of the estimator's rate error against the table's truth at the very instants, rad/s,
        per axis of b.
        """
        found = [
            m
            for m in self.seen["rate"]
            if m.estimator == estimator and m.header.device_us * 1e-6 >= since_s
        ]
        times = np.array([world_time(self.board, m.header.device_us) for m in found])
        truth = np.array([t.omega_ib_b for t in self.test.truths(times)])
        error = np.array([m.omega_ib_b_radps for m in found]) - truth
        return np.sqrt((error**2).mean(axis=0))

    def close(self) -> None:
        self.link.journal.close()
        self.link.spool.close()
