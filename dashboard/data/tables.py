"""The columns of every table that the charts read: name, unit and shape, declared here and nowhere
else.

A table is held as a numpy structured array of float64, so that a panel asks for a column by name:
``rows["omega_ib_b"]`` is (n, 3), ``rows["angle_z"]`` is (n,). What a message does not say is NaN.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from messages.contract import topics as tp

AXES = 12  # of an array whose messages have not said another number
ADC_CHANNELS = 8


@dataclass(frozen=True)
class Column:
    """One column: one number for each row, or `width` of them."""

    name: str
    unit: str
    width: int = 0


@dataclass(frozen=True)
class Table:
    """The columns of one topic, and how many rows a second are kept of it."""

    rate: float  # rows/s that HISTORY_S is kept for
    columns: tuple[Column, ...]

    def dtype(self, **widths: int) -> np.dtype:
        """Type of a row, time `t` (s) first; `widths` of columns that differ from the declared."""
        shapes = [(c.name, widths.get(c.name, c.width)) for c in self.columns]
        return np.dtype([("t", float)] + [(n, float, (w,) if w else ()) for n, w in shapes])


ACCEL = Table(200.0, (Column("f", "m/s²", AXES),))
IMU = Table(200.0, (Column("f_b", "m/s²", 3), Column("omega_ib_b", "rad/s", 3)))
ADC = Table(tp.ADC.rate, (Column("counts", "", ADC_CHANNELS),))
TACHO = Table(100.0, (Column("omega", "rad/s"), Column("sigma", "rad/s")))
TRUTH = Table(
    tp.TRUTH.rate,
    (Column("omega_ib_b", "rad/s", 3), Column("f_b", "m/s²", 3), Column("angle_z", "rad")),
)
RATE = Table(
    tp.RATE.rate,  # rows, not messages
    (
        Column("omega_ib_b", "rad/s", 3),
        Column("sigma", "rad/s", 3),  # of omega_ib_b
        Column("bound", "rad/s", 3),  # Cramer-Rao, 1 sigma
        Column("sight", "", 3),  # RateEstimate.Sight
        Column("f_b", "m/s²", 3),
        Column("angle_z", "rad"),
        Column("yaw", "rad"),
        Column("p_n", "m", 3),
        Column("innovation", "innovation_unit", 6),
        Column("innovation_sigma", "innovation_unit", 6),
        Column("nis", ""),  # NaN at a sample without a correction
        Column("nis_dof", ""),
    ),
)
ATTITUDE = Table(
    tp.ATTITUDE.rate, (Column("roll", "rad"), Column("pitch", "rad"), Column("bias", "rad/s", 3))
)
NAV = Table(
    50.0,
    (
        Column("p_n", "m", 3),
        Column("v_n", "m/s", 3),
        Column("sigma_p_n", "m", 3),
        Column("yaw", "rad"),
        Column("horizon", "fixes"),  # of a moving horizon: N
        Column("crisp", "fixes"),  # N before it is rounded, of fuzzy rules
        Column("inputs", "m/s², rad/s", 2),
        Column("membership", "", 6),
    ),
)
GNSS = Table(
    10.0,
    (
        Column("p_n", "m", 3),
        Column("latitude", "deg"),
        Column("longitude", "deg"),
        Column("sigma_p_n", "m", 3),
        Column("quality", ""),  # GnssFix.Quality
    ),
)
INNOVATION = Table(
    10.0,
    (
        Column("value", "m, m/s", 6),
        Column("sigma", "m, m/s", 6),
        Column("nis", ""),
        Column("error", "m", 3),  # of a fix that was held back: navigation minus fix, NED
        Column("ahead", "m", 3),  # fix minus prediction, NED
        Column("residual", "m", 3),  # fix minus solution, NED
    ),
)

TABLES: Mapping[str, Table] = {
    tp.ACCEL.name: ACCEL,
    tp.IMU.name: IMU,
    tp.ADC.name: ADC,
    tp.TACHO.name: TACHO,
    tp.TRUTH.name: TRUTH,
    tp.RATE.name: RATE,
    tp.ATTITUDE.name: ATTITUDE,
    tp.NAV.name: NAV,
    tp.GNSS.name: GNSS,
    tp.INNOVATION.name: INNOVATION,
}
