"""Orders to the estimator of a device: guided calibrations and calibration files. Part of the
shell: knows messages.

A Pipeline hands it samples and EstimatorCommands; what it says is a function of these, except for
the files of cards, which stand in the folder `cards` of the settings as <id>.toml.
"""

import datetime
import logging
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimator.convert.header import as_list, sample_header
from estimator.convert.samples import Samples
from inertial.calibration.card import Card, CardError, read_card, write_card
from inertial.calibration.fit import CalibrationError
from inertial.calibration.guided import FITTED, SAVED, GuidedCalibration
from inertial.layouts.layout import Layout
from messages.contract import gyrofree_pb2 as pb

log = logging.getLogger(__name__)

Array = NDArray[np.float64]

STATUS_S = 0.5  # of data, between two words of a running calibration
CARD = re.compile(r"[a-z][A-Za-z0-9_-]{0,80}")


class CalibrationDesk:
    """Guided calibrations of all devices, and the cards that were taken into use while the
    estimator ran.
    """

    def __init__(self, cards: Path) -> None:
        """cards: folder of saved cards."""
        self._cards = cards
        self._sessions: dict[str, GuidedCalibration] = {}
        self._headers: dict[
            str, bytes
        ] = {}  # of the newest batch; bytes, because the pipeline's state is saved
        self._next: dict[
            str, tuple[int, int]
        ] = {}  # boot and index that the next batch should have
        self._said: dict[str, float] = {}  # s of the board's clock
        self._saved: dict[str, str] = {}
        self.used: dict[str, Card | None] = {}  # by device; absent: as the settings say

    def feed(
        self, batch: pb.AccelBatch, samples: Samples, layout: Layout
    ) -> pb.CalibrationStatus | None:
        """A batch of a device: axis readings at nominal scale; a status twice a second while a
        calibration runs.
        """
        device = batch.header.device
        self._headers[device] = batch.header.SerializeToString()
        session = self._sessions.get(device)
        if session is None:
            return None
        here = (batch.header.epoch, batch.first_index)
        if self._next.get(device, here) != here:
            session.gap()
        self._next[device] = (batch.header.epoch, batch.first_index + len(samples.t_s))
        readings = layout.read(samples.values)
        if readings.shape[1] != session.layout.axes:
            return None
        session.feed(samples.t_s, readings)
        t = float(samples.t_s[-1])
        if abs(t - self._said.get(device, -1e9)) < STATUS_S:
            return None
        self._said[device] = t
        return self.status(device)

    def tacho(self, message: pb.TachoRate) -> None:
        """A report of a device's tachometer."""
        session = self._sessions.get(message.header.device)
        if session is not None and np.isfinite(message.omega_radps):
            session.tacho(message.header.device_us * 1e-6, message.omega_radps)

    def order(
        self, command: pb.EstimatorCommand, layout: Layout
    ) -> tuple[pb.Reply, pb.CalibrationStatus | None]:
        """Do what a person asked for; layout is the nominal one of the device."""
        act = {
            pb.EstimatorCommand.ACTION_CALIBRATE_START: self._start,
            pb.EstimatorCommand.ACTION_CALIBRATE_FIT: self._fit,
            pb.EstimatorCommand.ACTION_CALIBRATE_SAVE: self._save,
            pb.EstimatorCommand.ACTION_CALIBRATE_CANCEL: self._cancel,
            pb.EstimatorCommand.ACTION_USE_CARD: self._use,
        }.get(command.action)
        if act is None:
            return pb.Reply(ok=False, message=f"no order {command.action} for an estimator"), None
        try:
            said = act(command, layout)
        except (CalibrationError, CardError, OSError) as error:
            return pb.Reply(ok=False, message=str(error)), None
        log.info("%s: %s (by %s)", command.device, said, command.user or "nobody named")
        return pb.Reply(ok=True, message=said), self.status(command.device)

    def status(self, device: str) -> pb.CalibrationStatus | None:
        """Where a device's calibration stands; None before any batch of it."""
        session = self._sessions.get(device)
        if device not in self._headers:
            return None
        header = pb.Header.FromString(self._headers[device])
        message = pb.CalibrationStatus(header=sample_header(header, 0.0))
        used = self.used.get(device)
        message.card = self._saved.get(device, "") or (used.id if used is not None else "")
        if session is None:
            message.instruction = "start a calibration to be guided through it"
            return message
        message.state = session.state
        message.instruction, message.message = session.instruction, session.message
        message.progress, message.good_enough = session.progress, session.good_enough
        for up_b, samples, scatter in session.poses:
            message.poses.add(up_b=as_list(up_b), samples=samples, scatter_mps2=scatter)
        if session.fit is not None:
            message.bias_sigma_mps2[:] = as_list(session.fit.bias_sigma)
            message.scale_sigma[:] = as_list(session.fit.scale_sigma)
            message.residual_mps2 = float(np.sqrt(np.mean(session.fit.residual**2)))
        if session.next_up is not None:
            message.next_up_b[:] = as_list(session.next_up)
        return message

    # --- the orders

    def _start(self, command: pb.EstimatorCommand, layout: Layout) -> str:
        if command.device not in self._headers:
            raise CalibrationError(
                f"{command.device}: no accelerometer samples yet; connect the board first"
            )
        self._sessions[command.device] = GuidedCalibration(layout)
        self._saved.pop(command.device, None)
        self._next.pop(command.device, None)
        return "calibration started"

    def _running(self, device: str) -> GuidedCalibration:
        if device not in self._sessions:
            raise CalibrationError(f"{device}: no calibration runs; start one first")
        return self._sessions[device]

    def _fit(self, command: pb.EstimatorCommand, layout: Layout) -> str:
        session = self._running(command.device)
        solved = session.solve()
        residual = float(np.sqrt(np.mean(solved.residual**2)))
        quality = "good enough" if session.good_enough else "not good enough yet"
        data = f"{len(session.poses)} poses and {session.steps} table runs"
        return f"fitted {data}, residual {residual:.4f} m/s², {quality}"

    def _save(self, command: pb.EstimatorCommand, layout: Layout) -> str:
        session, header = (
            self._running(command.device),
            pb.Header.FromString(self._headers[command.device]),
        )
        moment = datetime.datetime.fromtimestamp(header.utc_ns * 1e-9, datetime.UTC)
        card = session.card(command.device, moment.strftime("%Y-%m-%dT%H:%M:%SZ"))
        path = self._cards / f"{card.id}.toml"
        write_card(card, path)
        session.state = SAVED if session.state == FITTED else session.state
        self._saved[command.device] = card.id
        self.used[command.device] = card
        return (
            f"card {card.id} saved and in use; estimators begin anew. To keep it after a restart"
            " set "
            f'[estimator.calibrations] {command.device} = "{path}"'
        )

    def _cancel(self, command: pb.EstimatorCommand, layout: Layout) -> str:
        self._running(command.device)
        del self._sessions[command.device]
        return "calibration ended, nothing kept"

    def _use(self, command: pb.EstimatorCommand, layout: Layout) -> str:
        if not command.card:
            self.used[command.device] = None
            return "no card in use; estimators begin anew"
        if not CARD.fullmatch(command.card):
            raise CardError(
                f"card {command.card!r}: want the id of a saved card, like cube-20260102-1a2b3c4d"
            )
        card = read_card(self._cards / f"{command.card}.toml")
        card.layout(layout)
        self.used[command.device] = card
        return f"card {card.id} in use; estimators begin anew"
