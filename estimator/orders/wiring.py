"""Orders about axis maps: guided detections of axes and signs, and the maps in use. Part of the
shell: knows messages.

A Pipeline hands it samples and EstimatorCommands; what it says is a function of these, except for
the files of maps, which stand in the folder `axes` of the settings as <id>.toml.
"""

import datetime
import logging
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimator.choice import UnknownEstimator
from estimator.convert.header import sample_header
from estimator.settings import EstimatorSettings
from inertial.attitude.axis_map import IMU, AxisMap, Figures, MapError, read_map, write_map
from inertial.attitude.wiring import (
    FORCE_REST,
    FOUND,
    RATE_REST,
    SAVED,
    VOLT_REST,
    BoardColumns,
    GuidedWiring,
)
from messages.contract import gyrofree_pb2 as pb

log = logging.getLogger(__name__)

Array = NDArray[np.float64]
Batch = pb.ImuBatch | pb.AdcBatch

STATUS_S = 0.25  # of data, between two words of a running detection
MAP = re.compile(r"[a-z][A-Za-z0-9_-]{0,80}")
ACTIONS = (
    pb.EstimatorCommand.ACTION_WIRING_START,
    pb.EstimatorCommand.ACTION_WIRING_SAVE,
    pb.EstimatorCommand.ACTION_WIRING_CANCEL,
    pb.EstimatorCommand.ACTION_USE_MAP,
)


class WiringDesk:
    """Guided detections of all devices, and the axis map that each device uses."""

    def __init__(self, folder: Path, maps: dict[str, Path]) -> None:
        """folder: of saved maps; maps: those of the settings, by device. Raises MapError,
        OSError.
        """
        self._folder = folder
        self.used: dict[str, AxisMap] = {device: read_map(path) for device, path in maps.items()}
        self._sessions: dict[str, GuidedWiring] = {}
        self._newest: dict[
            tuple[str, str], bytes
        ] = {}  # newest batch of a device and source; the state is pickled
        self._next: dict[str, tuple[int, int]] = {}
        self._said: dict[str, float] = {}

    def wants(self, device: str, source: str) -> bool:
        """Whether batches of this kind are of use now."""
        used = self.used.get(device)
        return (
            (device, source) not in self._newest
            or device in self._sessions
            or (used is not None and used.source == source)
        )

    def feed(self, batch: Batch, source: str, values: Array) -> pb.WiringStatus | None:
        """A batch of columns (n, columns): of the converter V, else SI. A status 4 times a second
        while one runs.
        """
        device = batch.header.device
        first = (device, source) not in self._newest
        if first or device in self._sessions:
            self._newest[device, source] = batch.SerializeToString()
        session = self._sessions.get(device)
        if (
            session is None
            or session.board.source != source
            or values.shape[1] != len(session.board.names)
        ):
            return None
        here = (batch.header.epoch, batch.first_index)
        if self._next.get(device, here) != here:
            session.gap()
        self._next[device] = (batch.header.epoch, batch.first_index + len(values))
        session.feed(batch.period_s, values)
        t = batch.header.device_us * 1e-6
        if abs(t - self._said.get(device, -1e9)) < STATUS_S:
            return None
        self._said[device] = t
        return self.status(device)

    def order(self, command: pb.EstimatorCommand) -> tuple[pb.Reply, pb.WiringStatus | None]:
        """Do what a person asked for."""
        act = {
            pb.EstimatorCommand.ACTION_WIRING_START: self._start,
            pb.EstimatorCommand.ACTION_WIRING_SAVE: self._save,
            pb.EstimatorCommand.ACTION_WIRING_CANCEL: self._cancel,
            pb.EstimatorCommand.ACTION_USE_MAP: self._use,
        }[command.action]
        try:
            said = act(command)
        except (MapError, OSError) as error:
            return pb.Reply(ok=False, message=str(error)), None
        log.info("%s: %s (by %s)", command.device, said, command.user or "nobody named")
        return pb.Reply(ok=True, message=said), self.status(command.device)

    def status(self, device: str) -> pb.WiringStatus | None:
        """Where a device's detection stands; None before any batch of it."""
        source = self._source(device)
        if not source:
            return None
        header = self._batch(device, source).header
        used = self.used.get(device)
        message = pb.WiringStatus(header=sample_header(header, 0.0), source=source)
        message.map = used.id if used is not None else ""
        session = self._sessions.get(device)
        if session is None:
            message.instruction = "start the detection to be guided through it"
            return message
        return _message(message, session)

    # --- the orders

    def _source(self, device: str) -> str:
        """The converter's counts where there are any: the gateway's own wiring may be wrong."""
        return next((source for source in ("adc", "imu") if (device, source) in self._newest), "")

    def _batch(self, device: str, source: str) -> Batch:
        return (pb.AdcBatch if source == "adc" else pb.ImuBatch).FromString(
            self._newest[device, source]
        )

    def _start(self, command: pb.EstimatorCommand) -> str:
        source = self._source(command.device)
        if not source:
            raise MapError(
                f"{command.device}: no samples of an accelerometer and gyroscope board yet; connect"
                " the board first"
            )
        self._sessions[command.device] = GuidedWiring(
            wiring_board(self._batch(command.device, source))
        )
        self._next.pop(command.device, None)
        return "detection of axes and signs started"

    def _running(self, device: str) -> GuidedWiring:
        if device not in self._sessions:
            raise MapError(f"{device}: no detection runs; start one first")
        return self._sessions[device]

    def _save(self, command: pb.EstimatorCommand) -> str:
        device, session = command.device, self._running(command.device)
        if not session.complete:
            raise MapError(f"{device}: not every axis is found yet: {session.instruction}")
        header = self._batch(device, session.board.source).header
        moment = datetime.datetime.fromtimestamp(header.utc_ns * 1e-9, datetime.UTC)
        found = session.map.named(device, moment.strftime("%Y-%m-%dT%H:%M:%SZ"))
        path = self._folder / f"{found.id}.toml"
        write_map(found, path)
        session.state = SAVED
        self.used[device] = found
        return (
            f"axis map {found.id} saved and in use; the filters begin anew. To keep it after a"
            " restart set "
            f'[estimator.axis_maps] {device} = "{path}"'
        )

    def _cancel(self, command: pb.EstimatorCommand) -> str:
        session = self._running(command.device)
        del self._sessions[command.device]
        return (
            "detection closed"
            if session.state in (FOUND, SAVED)
            else "detection ended, nothing kept"
        )

    def _use(self, command: pb.EstimatorCommand) -> str:
        if not command.card:
            self.used.pop(command.device, None)
            return "no axis map in use; the filters begin anew"
        if not MAP.fullmatch(command.card):
            raise MapError(
                f"axis map {command.card!r}: want the id of a saved one, like"
                " board-axes-20260102-1a2b3c4d"
            )
        self.used[command.device] = read_map(self._folder / f"{command.card}.toml")
        return f"axis map {command.card} in use; the filters begin anew"


def load(settings: EstimatorSettings) -> WiringDesk:
    """The desk with the axis maps of the settings; raises UnknownEstimator for a file that is
    none.
    """
    try:
        return WiringDesk(settings.axes, settings.axis_maps)
    except (MapError, OSError) as error:
        raise UnknownEstimator(f"[estimator] axis_maps: {error}") from None


def wiring_board(batch: Batch) -> BoardColumns:
    """What the columns of a board's batches are; raises MapError for counts that nothing is known
    of.
    """
    if isinstance(batch, pb.ImuBatch):
        quantum = np.array([0.01] * 3 + [0.001] * 3)  # m/s^2, rad/s
        return BoardColumns("imu", IMU, quantum, np.array([FORCE_REST] * 3 + [RATE_REST] * 3))
    n, device = batch.channels, batch.header.device
    inputs = [i for i in range(32) if batch.channel_mask >> i & 1]
    if len(inputs) != n or not (batch.accel_v_per_mps2 > 0.0 and batch.gyro_v_per_radps > 0.0):
        raise MapError(
            f"{device}: its batches do not say what their inputs are: they are of an older gateway"
        )
    figures = Figures(
        batch.zero_g_v, batch.accel_v_per_mps2, batch.zero_rate_v, batch.gyro_v_per_radps
    )
    names = tuple(f"input {i}" for i in inputs)
    return BoardColumns(
        "adc", names, np.full(n, batch.volt_per_count), np.full(n, VOLT_REST), figures
    )


def _message(message: pb.WiringStatus, session: GuidedWiring) -> pb.WiringStatus:
    message.state, message.pose = session.state, session.pose
    message.instruction, message.message = session.instruction, session.message
    message.progress, message.complete = session.progress, session.complete
    for column, name in enumerate(session.board.names):
        axis, inverted = session.axis_of(column)
        reading, unit = float(session.reading[column]), "V"
        if session.board.source == "imu":
            reading, unit = (reading, "m/s²") if column < 3 else (float(np.degrees(reading)), "°/s")
        message.inputs.add(
            name=name,
            reading=reading,
            unit=unit,
            axis=axis,
            inverted=inverted,
            unused=column in session.unused,
        )
    for turn in session.turns:
        message.turns.add(about=turn.about, by_force_rad=turn.by_force, by_rate_rad=turn.by_rate)
    return message
