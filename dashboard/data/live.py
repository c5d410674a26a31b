"""The newest word on a device's rate, attitude and place, for programs: what is not known is None.

SI and degrees of latitude and longitude; omega of b against inertial in b, attitude q_nb, n
north-east-down.
"""

import math
from collections.abc import Sequence
from typing import Any

from dashboard.data.device import Device, Latest
from dashboard.data.lateness import Age, age_of
from dashboard.data.store import Store
from messages.contract import gyrofree_pb2 as pb
from messages.contract import rates

SIGHTS = {0: "valid", 1: "ambiguous", 2: "blind"}
ESTIMATED = ("rate", "attitude", "nav")
Live = dict[str, Any]


def finite(value: float) -> float | None:
    """None for what is no number."""
    return float(value) if math.isfinite(value) else None


def numbers(values: Sequence[float]) -> list[float | None] | None:
    """None where nothing is said."""
    return [finite(value) for value in values] or None


def live(device: Device, topic: str, estimator: str = "") -> Live | None:
    """The newest of a topic by an estimator, the leading one when none is named; None without
    any. Read it under the store's lock.
    """
    names = device.estimators(topic)
    if topic == "attitude" and not names:  # a cube's rate estimators follow its attitude too
        names = device.estimators("rate")
        chosen = estimator or (names[0] if names else "")
        latest = device.get("rate", chosen)
        return None if latest is None else _about(device, "rate", chosen, latest) | _turned(latest)
    chosen = estimator or (names[0] if names else "")
    latest = device.get(topic, chosen)
    if latest is None:
        return None
    made = {"rate": _rate, "attitude": _attitude, "nav": _nav}[topic]
    return _about(device, topic, chosen, latest) | made(latest)


def aged(age: Age) -> Live:
    """By the clock of the site: what is not known is None, and why is said."""
    return {
        "site_age_s": finite(age.s),
        "site_age_bound_s": finite(age.bound_s),
        "site_age_why": age.why,
    }


def live_aged(store: Store, device: Device, topic: str, estimator: str = "") -> Live | None:
    """The same with its age by the clock of the site."""
    said = live(device, topic, estimator)
    if said is None:
        return None
    utc_s, sigma_s = said["utc_s"], said.pop("utc_sigma_s")
    return said | aged(age_of(store, device, utc_s, sigma_s))


def _about(device: Device, topic: str, estimator: str, latest: Latest) -> Live:
    message = latest.message
    after_s = (rates.count(message) - 1) * message.period_s if topic == "rate" else 0.0
    return {
        "device": device.name,
        "estimator": estimator,
        "utc_s": message.header.utc_ns * 1e-9 + after_s,
        "utc_sigma_s": message.header.utc_sigma_s,
        "age_s": latest.age(),
        "stale": device.stale(topic, estimator),
        "simulated": message.header.source in (pb.SOURCE_SIMULATED, pb.SOURCE_EMULATED),
    }


def _rate(latest: Latest) -> Live:
    one = rates.row(latest.message, -1)
    sight = [SIGHTS.get(int(value), "blind") for value in one.sight] or ["blind"] * 3
    variances = one.omega_covariance[::4]
    return {
        "omega_radps": [
            None if known == "blind" else finite(value)
            for value, known in zip(one.omega_ib_b_radps, sight, strict=False)
        ],
        "sigma_radps": [finite(math.sqrt(max(0.0, value))) for value in variances],
        "sight": sight,
        "why": one.sight_reason,
        "still": one.still,
        "alpha_radps2": numbers(one.alpha_b_radps2),
        "f_mps2": numbers(one.f_b_mps2),
        "aid": one.aid,
    }


def _turned(latest: Latest) -> Live:
    one = rates.row(latest.message, -1)
    blind = all(int(value) == 2 for value in one.sight)
    return {
        "q_nb": None if blind else numbers(one.q_nb),
        "heading_known": False,
        "inclination_sigma_rad": None,
    }


def _attitude(latest: Latest) -> Live:
    m = latest.message
    return {
        "q_nb": numbers(m.q_nb),
        "heading_known": m.heading_known,
        "inclination_sigma_rad": m.inclination_sigma_rad or None,
    }


def _nav(latest: Latest) -> Live:
    m = latest.message
    there = m.mode == pb.NavSolution.MODE_NAVIGATING
    sigma = list(m.sigma) if there else []
    return {
        "mode": pb.NavSolution.Mode.Name(m.mode).removeprefix("MODE_").lower(),
        "why": m.alignment,
        "latitude_deg": finite(m.latitude_deg) if there else None,
        "longitude_deg": finite(m.longitude_deg) if there else None,
        "height_m": finite(m.height_m) if there else None,
        "v_n_mps": numbers(m.v_n_mps) if there else None,
        "q_nb": numbers(m.q_nb) if there else None,
        "sigma_attitude_rad": numbers(sigma[:3]),
        "sigma_v_n_mps": numbers(sigma[3:6]),
        "sigma_position_ned_m": numbers(sigma[6:9]),
        "fix_age_s": finite(m.fix_age_s),
    }
