"""The measured noise by its definition: third differences of all that was read (E-58).

Twin of inertial/core/rate/noise.cpp.
"""

import numpy as np

MEMORY, CLIP = 128, 6.0
QUIET_SLACK, FORCE_SLACK = 0.3, 0.5


def ratios(y, s):
    """Ratio of every sample's third difference to the configured noise: of omega' and c, of p."""
    d = np.diff(y, 3, axis=0) ** 2 / 20.0
    seen = np.concatenate([np.diag(s.R_alpha), np.diag(s.R_c)[: s.m]])
    return (d[:, : 3 + s.m] / seen).mean(axis=1), (d[:, 9:] / np.diag(s.R_p)).mean(axis=1)


def mean(values):
    """The clipped running mean after all values."""
    out = 0.0
    for k, value in enumerate(values):
        out += (min(value, CLIP * max(out, 1.0)) - out) / min(k + 1, MEMORY)
    return out


def noise(y, s):
    """Variances over the configured ones after samples y (n, 12): of omega' and c, of p."""
    more = np.sqrt(MEMORY / min(len(y) - 3, MEMORY))
    quiet, force = (mean(values) for values in ratios(y, s))
    return (
        quiet if quiet >= 1.0 + QUIET_SLACK * more else 1.0,
        force if force >= 1.0 + FORCE_SLACK * more else 1.0,
    )
