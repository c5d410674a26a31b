"""The calibration file: what a fit found about one device, as a TOML file that estimates can name.

A corrected reading is (m - bias) / scale along direction_b at position_b_m; estimators then work
with the layout of the card instead of the nominal one. Format version 1.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.calibration.fit import Fit
from inertial.elementary import norm
from inertial.layouts.layout import Layout
from inertial.toml_file import read_versioned, write_whole

Array = NDArray[np.float64]

VERSION = 1


class CardError(ValueError):
    """A card that cannot be used, or does not belong to the axes it is applied to."""


@dataclass(frozen=True, eq=False)
class Card:
    """A calibration file. Arrays over the axes (N)."""

    id: str
    date: str  # ISO 8601, UTC
    device: str
    uid: str  # of the board, where known
    layout_name: str
    names: tuple[str, ...]
    bias: Array  # (N,) m/s^2
    scale: Array  # (N,) reading over truth
    direction_b: Array  # (N, 3) unit vectors
    position_b: Array  # (N, 3) m
    covariance: Array  # (N, 7, 7) of bias, scale times direction (3), position (3)
    residual: Array  # (N,) m/s^2, RMS
    observed: NDArray[np.bool_]  # (N, 7): did the data narrow it?
    noise: Array  # (N,) m/s^2, of one sample
    poses: int
    steps: int  # mountings on the table
    chi2: float  # per degree of freedom
    data: tuple[tuple[str, str], ...]  # file name and SHA-256 of the logs

    def layout(self, nominal: Layout) -> Layout:
        """The calibrated layout; raises CardError for axes of another layout."""
        if nominal.axes != len(self.bias) or nominal.name != self.layout_name:
            raise CardError(
                f"calibration file {self.id} is for layout {self.layout_name} with {len(self.bias)}"
                f" axes, not for {nominal.name} with {nominal.axes}: name the card of this device,"
                " or calibrate it"
            )
        return replace(nominal, r_b=self.position_b, theta_b=self.direction_b)

    def correct(self, f_axis: Array) -> Array:
        """Readings (..., N) in m/s^2 at nominal scale without bias and scale error."""
        return (f_axis - self.bias) / self.scale

    @property
    def residual_rms(self) -> float:
        """m/s^2, of all axes."""
        return float(np.sqrt(np.mean(self.residual**2)))


def make_card(
    fit: Fit,
    nominal: Layout,
    names: Sequence[str],
    *,
    device: str,
    date: str,
    uid: str = "",
    poses: int = 0,
    steps: int = 0,
    data: Sequence[tuple[str, str]] = (),
) -> Card:
    """Card of a fit. Its id is the device, the day and eight digits of what it holds."""
    p = fit.parameters
    holds = hashlib.sha256(
        b"".join(np.round(x, 9).tobytes() for x in (p.b, p.c, p.r)) + date.encode()
    )
    return Card(
        id=f"{device}-{date[:10].replace('-', '')}-{holds.hexdigest()[:8]}",
        date=date,
        device=device,
        uid=uid,
        layout_name=nominal.name,
        names=tuple(names),
        bias=p.b.copy(),
        scale=fit.scale,
        direction_b=fit.direction,
        position_b=p.r[fit.place],
        covariance=np.array([fit.axis_covariance(i) for i in range(fit.axes)]),
        residual=fit.residual,
        observed=_observed(fit),
        noise=fit.noise,
        poses=poses,
        steps=steps,
        chi2=fit.chi2,
        data=tuple(data),
    )


def _observed(fit: Fit) -> NDArray[np.bool_]:
    """(N, 7): which of bias, direction times scale and position of an axis the data narrowed."""
    n, narrowed = fit.axes, fit.narrowed < 0.5
    bias, along = narrowed[:n, None], narrowed[n : 4 * n].reshape(n, 3)
    place = narrowed[4 * n :].reshape(-1, 3)[fit.place]
    return np.hstack([bias, along, place])


def sigmas(card: Card) -> dict[str, Array]:
    """One-sigma values by name: bias (N,) m/s^2, scale (N,), misalignment (N,) rad, position (N, 3)
    m.
    """
    C = card.covariance
    along = card.direction_b
    scale2 = np.einsum("ni,nij,nj->n", along, C[:, 1:4, 1:4], along)
    total = np.trace(C[:, 1:4, 1:4], axis1=1, axis2=2)
    return {
        "bias": np.sqrt(C[:, 0, 0]),
        "scale": np.sqrt(scale2),
        "misalignment": np.sqrt(np.maximum(total - scale2, 0.0) / 2.0) / card.scale,
        "position": np.sqrt(np.diagonal(C, axis1=1, axis2=2)[:, 4:7]),
    }


def as_dict(card: Card) -> dict[str, Any]:
    """The card as its file has it."""
    sigma = sigmas(card)
    axes = [
        {
            "name": card.names[i],
            "bias_mps2": float(card.bias[i]),
            "scale": float(card.scale[i]),
            "direction_b": card.direction_b[i].tolist(),
            "position_b_m": card.position_b[i].tolist(),
            "noise_mps2": float(card.noise[i]),
            "residual_mps2": float(card.residual[i]),
            "sigma": {
                "bias_mps2": float(sigma["bias"][i]),
                "scale": float(sigma["scale"][i]),
                "misalignment_rad": float(sigma["misalignment"][i]),
                "position_m": sigma["position"][i].tolist(),
            },
            "observed": card.observed[i].tolist(),
            "covariance": card.covariance[i].ravel().tolist(),
        }
        for i in range(len(card.names))
    ]
    return {
        "version": VERSION,
        "id": card.id,
        "date": card.date,
        "device": card.device,
        "uid": card.uid,
        "layout": card.layout_name,
        "fit": {
            "poses": card.poses,
            "steps": card.steps,
            "chi2_per_dof": card.chi2,
            "residual_mps2": card.residual_rms,
        },
        "temperature": {
            "model": "none"
        },  # reserved: one card holds for the temperature it was made at
        "data": [{"name": name, "sha256": digest} for name, digest in card.data],
        "axes": axes,
    }


def write_card(card: Card, path: Path) -> None:
    """Write a card whole or not at all; raises OSError."""
    write_whole(as_dict(card), path)


def read_card(path: Path) -> Card:
    """Read a card; raises CardError for a file that is none, OSError for one that cannot be
    read.
    """
    return read_versioned(path, "calibration file", VERSION, _card, CardError, ": calibrate again")


def _card(table: dict[str, Any]) -> Card:
    axes = table["axes"]

    def column(name: str) -> Array:
        return np.array([axis[name] for axis in axes], dtype=np.float64)

    n = len(axes)
    values = {name: column(name) for name in ("bias_mps2", "scale", "direction_b", "position_b_m")}
    if n == 0 or values["direction_b"].shape != (n, 3) or values["position_b_m"].shape != (n, 3):
        raise ValueError("directions and positions want three numbers per axis")
    if (
        not all(np.isfinite(value).all() for value in values.values())
        or not (values["scale"] > 0.1).all()
    ):
        raise ValueError("values want finite numbers, scales above 0.1")
    return Card(
        id=str(table["id"]),
        date=str(table["date"]),
        device=str(table["device"]),
        uid=str(table["uid"]),
        layout_name=str(table["layout"]),
        names=tuple(str(axis["name"]) for axis in axes),
        bias=values["bias_mps2"],
        scale=values["scale"],
        direction_b=values["direction_b"] / norm(values["direction_b"])[:, None],
        position_b=values["position_b_m"],
        covariance=column("covariance").reshape(n, 7, 7),
        residual=column("residual_mps2"),
        observed=np.array([axis["observed"] for axis in axes], dtype=bool).reshape(n, 7),
        noise=column("noise_mps2"),
        poses=int(table["fit"]["poses"]),
        steps=int(table["fit"]["steps"]),
        chi2=float(table["fit"]["chi2_per_dof"]),
        data=tuple((str(one["name"]), str(one["sha256"])) for one in table["data"]),
    )
