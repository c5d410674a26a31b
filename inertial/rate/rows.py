"""What the core says after each sample: structured arrays whose fields are those of RateColumns."""

import numpy as np
from numpy.typing import NDArray

from inertial.core import native

Array = NDArray[np.float64]
Rows = NDArray[np.void]


def _row_type() -> np.dtype:
    fields = native.rate_row_fields()
    names, types, shapes, offsets = zip(*fields, strict=True)
    return np.dtype(
        {
            "names": names,
            "formats": list(zip(types, shapes, strict=True)),
            "offsets": offsets,
            "itemsize": native.RATE_ROW_BYTES,
        }
    )


ROW = _row_type()
BYTES = native.RATE_ROW_BYTES


def after(core: object, t_s: Array, f_axis: Array) -> Rows:
    """Rows (n,) after samples (n, N), m/s^2, at t_s (n,), s, both checked, of an estimator of the
    core.
    """
    rows = np.empty(len(t_s), ROW)
    core.run(t_s, f_axis, rows.view(np.uint8).reshape(-1, BYTES))
    return rows
