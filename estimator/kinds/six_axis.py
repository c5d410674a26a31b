"""A six-axis board: which of its columns is which axis, and then a vehicle and a tilt of it.

In: ImuBatch; AdcBatch of an analogue board while a detection of axes runs or a map of inputs is
used. Estimators: those of kinds/vehicle.py and kinds/tilt.py, on the columns as they are, or as the
axis map in use turns them. Out: theirs, and WiringStatus while a detection runs.
"""

import numpy as np

from estimator.convert.samples import Array, BadMessage, Samples, adc_samples, imu_samples
from estimator.devices.navigation import NavBoard
from estimator.kinds.common import Common
from estimator.kinds.navigation import Batch
from estimator.kinds.tilt import Tilt
from estimator.kinds.vehicle import Vehicle
from estimator.orders.wiring import WiringDesk
from estimator.output import Output
from inertial.attitude.axis_map import MapError
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import WIRING


class SixAxis:
    """One device."""

    def __init__(self, device: str, common: Common, axes: WiringDesk) -> None:
        self._device, self._common, self._axes = device, common, axes
        self._vehicle: Vehicle | None = None
        self._tilt: Tilt | None = None

    def begin_anew(self) -> None:
        """Other axes are in use: what the filters know is of no use any more."""
        self._vehicle = self._tilt = None

    @property
    def navigation(self) -> NavBoard | None:
        """Where fixes of this device go; None before its first samples."""
        return None if self._vehicle is None else self._vehicle.board

    def imu(self, batch: pb.ImuBatch) -> list[Output]:
        """By the axis map in use; a map of the converter's inputs leaves the batch out."""
        samples, rates = imu_samples(batch)
        used = self._device in self._axes.used
        if not used and not self._axes.wants(self._device, "imu"):
            return self._inertial(batch, samples, rates)
        columns = np.hstack([samples.values, rates])
        out = self._watch(batch, "imu", columns)
        if used:
            return out + self._mapped(batch, Samples(samples.t_s, columns), "imu")
        return out + self._inertial(batch, samples, rates)

    def adc(self, batch: pb.AdcBatch) -> list[Output]:
        """For a guided detection, and for the filters where a map of inputs is used."""
        if not self._axes.wants(self._device, "adc"):
            return []
        samples = adc_samples(batch)
        out = self._watch(batch, "adc", samples.values)
        return out + self._mapped(batch, samples, "adc")

    def _watch(self, batch: Batch, source: str, values: Array) -> list[Output]:
        status = self._axes.feed(batch, source, values)
        return [] if status is None else [Output(WIRING, self._device, "", status)]

    def _mapped(self, batch: Batch, columns: Samples, source: str) -> list[Output]:
        used = self._axes.used.get(self._device)
        if used is None or used.source != source:
            return []
        try:
            force, rates = used.apply(columns.values)
        except MapError as error:
            raise BadMessage(f"{self._device}: {error}") from None
        return self._inertial(batch, Samples(columns.t_s, force), rates)

    def _inertial(self, batch: Batch, samples: Samples, rates: Array) -> list[Output]:
        if self._vehicle is None or self._tilt is None:
            self._vehicle = Vehicle(self._device, self._common)
            self._tilt = Tilt(self._device, self._common)
        out = self._vehicle.take(batch, samples, rates)
        return out + self._tilt.take(batch, samples.values, rates)
