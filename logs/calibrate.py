"""Logs on disk to a calibration file: tumbles without a table and runs on the table, told apart by
the tachometer.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from inertial.calibration.card import Card, make_card
from inertial.calibration.fit import CalibrationError, Fit, Prior, fit
from inertial.calibration.model import Poses
from inertial.calibration.poses import collect, find, joined
from inertial.calibration.steps import blocks, turns
from inertial.layouts.layout import Layout
from logs.cube_log import read_log

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Made:
    """A card with what it was made of."""

    card: Card
    fit: Fit
    poses: Poses | None


def calibrate(
    logs: Sequence[Path],
    layout: Layout,
    *,
    device: str,
    date: str,
    uid: str = "",
    lsb_mg: float | None = None,
    prior: Prior = Prior(),
    progress: Progress = lambda done, what: None,
) -> Made:
    """Fit a card from logs; date is ISO 8601 in UTC. Logs in which a tachometer turns are table
    steps, others poses.

    Raises LogError, CalibrationError (both ValueError), OSError.
    """
    if not logs:
        raise CalibrationError("no log to calibrate from: name at least one with standing poses")
    parts, steps, noises, data = [], [], [], []
    for k, path in enumerate(logs):
        progress(0.6 * k / len(logs), f"reading {Path(path).name}")
        log = read_log(path, layout.axis_names, lsb_mg)
        f_axis = log.f_axis * np.array(layout.gain)
        data.append((Path(path).name, log.sha256))
        if log.tacho is not None and turns(log.tacho):
            steps.append(blocks(log.t_s, f_axis, log.tacho, log.period_s))
            continue
        try:
            found, noise = find(f_axis, log.period_s)
        except CalibrationError as error:
            raise CalibrationError(f"{path}: {error}") from None
        parts.append(collect(f_axis, found))
        noises.append(noise)
    poses = joined(parts)
    # Without a standstill there is no measured noise: the sensor's usual one stands for it.
    noise = np.median(noises, axis=0) if noises else np.asarray(layout.noise)
    progress(0.7, "fitting")
    solved = fit(layout, poses, steps, noise=np.maximum(noise, 1e-3), prior=prior)
    count = 0 if poses is None else len(poses.mean)
    card = make_card(
        solved,
        layout,
        layout.axis_names,
        device=device,
        date=date,
        uid=uid,
        poses=count,
        steps=len(steps),
        data=data,
    )
    progress(1.0, "done")
    return Made(card, solved, poses)


def advice(made: Made) -> list[str]:
    """What the data could not tell, and what would; empty when all is known."""
    card, said = made.card, []
    observed = card.observed
    if not observed[:, 0].all() or not observed[:, 1:4].all():
        names = [
            n for n, seen in zip(card.names, observed[:, :4].all(axis=1), strict=True) if not seen
        ]
        said.append(
            f"biases, scales and directions of {', '.join(names)} are not determined: take more"
            " poses"
        )
    if not card.steps:
        said.append("positions are nominal: add a log of table steps with tacho_rad_s to find them")
    elif not observed[:, 4:].all():
        missing = [
            f"{n} {'xyz'[k]}"
            for n, row in zip(card.names, observed[:, 4:], strict=True)
            for k in range(3)
            if not row[k]
        ]
        text = ", ".join(missing[:6]) + (" ..." if len(missing) > 6 else "")
        said.append(
            f"positions not determined: {text}; mount the body on another face and turn again"
        )
    if card.chi2 > 4.0:
        said.append(
            f"residuals are {np.sqrt(card.chi2):.1f} times what the noise explains: something"
            f" moved, or the axes are not those of layout {card.layout_name}"
        )
    return said
