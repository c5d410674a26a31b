"""Rate error of the gyro-free estimators on simulated tables, their cost, and the bound: one JSON
line per figure.

Sensors as published, uncalibrated: 4 mg noise, 3.9 mg counts, 20 mg biases, 0.5 % scale errors; 100
Hz, 30 s, 5 s of standstill first. Errors are RMS over all 30 s, deg/s, of the worst axis: median
over seeds. Figures to reach for products-ekf: 1.2 published, 1.4 wobble, 1.2 fast; angle at the end
3 deg in the median, never above 8; calibrated at most 1.3 times the bound; 2 us per sample in a
batch, 30 us live, 64 cubes at 100 Hz on one core. Honest figures of every case: over the samples
that an estimate calls valid (worst axis), its RMS, their share of the time, and how many of them
have the wrong sign (above 3 deg/s) or are beyond 5 sigma. The line of estimator
"products-ekf+resolved" is corrected backwards once the sign of a start while turning is known.
Usage: python tests/bench/bench_rate.py [seeds] [folder for pictures]
"""

import json
import sys
import time
from pathlib import Path

import numpy as np
from scipy.stats import chi2

sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent))

from inertial.rate import resolved, sight  # noqa: E402
from inertial.rate.bound import IN_USE, SOURCE, SOURCE_STILL, plot_bound, rate_bound, rms  # noqa: E402
from inertial.rate.estimators import ESTIMATORS, ProductsRate  # noqa: E402
from inertial.rate.products_ekf import Config  # noqa: E402
from inertial.simulation.profiles import DEGREE, TURNING  # noqa: E402
from inertial.simulation.table import SensorModel, TableTest  # noqa: E402

SEEN = 3.0 * DEGREE  # rad/s; a slower rate has no sign that matters
SETTLED_S = 2.0  # s; what a start while turning costs before is in the other figures
PUBLISHED = ("published", "wobble", "fast")
CASES = {name: {"profile": name} for name in PUBLISHED} | {
    "reversals": {"profile": "reversals"},
    "slow": {"profile": "slow"},
    "tilt-10-deg": {"tilt": 10.0 * DEGREE},
    "20-cm-off-the-axis": {"centre_b": (0.2, 0.1, 0.05)},
    "start-while-turning": {"profile": TURNING},
}
CALIBRATED = SensorModel(bias=0.02, scale_error=0.0)
CALIBRATED_CONFIG = Config(scale=0.0005)  # what a filter told of a calibration believes


class Log:
    """Three blocks of a table."""

    def __init__(self, seed: int, **options) -> None:
        self.table = TableTest(seed, **options)
        blocks = [self.table.block(k) for k in range(3)]
        names = ("t_s", "readings", "omega_b", "alpha_b", "q_nb", "angle_z")
        for name in names:
            setattr(self, name, np.concatenate([getattr(block, name) for block in blocks]))


def track(name: str, log: Log, late: bool = False, **options):
    """Rates (n, 3), covariances, NIS, angle and standstill after each sample, and which components
    are valid (n, 3).

    late: corrected backwards once the sign is known.
    """
    estimator = ESTIMATORS[name](log.table.layout, **options)
    if hasattr(estimator, "core"):
        out = estimator.run_batch(log.t_s, np.ascontiguousarray(log.readings))
        P, valid = out.P, out.sight == sight.VALID
        if late:
            fresh = ESTIMATORS[name](log.table.layout, **options)
            past = resolved.resolve(fresh.core, log.t_s, np.ascontiguousarray(log.readings))
            if past is not None:
                past.into(out.omega_b, P, out.angle_z, out.q_nb)
                valid[: len(past.omega_b)] = True
        return out.omega_b, P, out.nis, out.angle_z, out.still, valid
    states = [
        estimator.step(k, t, a) for k, (t, a) in enumerate(zip(log.t_s, log.readings, strict=True))
    ]
    named = [
        np.array([getattr(s, field) for s in states])
        for field in ("omega_b", "P", "nis", "angle_z", "still")
    ]
    return *named, np.array([s.sight for s in states]) == sight.VALID


def claims(omega, P, valid, truth) -> tuple[float, float, float, float]:
    """Of the worst axis: RMS (deg/s) over what is called valid, its share, of it wrong in sign,
    beyond 5 sigma.
    """
    error, sigma = omega - truth, np.sqrt(np.einsum("kii->ki", P))
    said = np.maximum(valid.sum(axis=0), 1)
    rms_valid = np.degrees(np.sqrt((error**2 * valid).sum(axis=0) / said))
    wrong = ((omega * truth < 0.0) & (np.abs(truth) > SEEN) & valid).sum(axis=0) / said
    beyond = ((np.abs(error) > 5.0 * sigma) & valid).sum(axis=0) / said
    return rms_valid.max(), valid.mean(axis=0).min(), wrong.max(), beyond.max()


def figures(name: str, case: str, seeds: int, late: bool = False, **options) -> dict:
    """Errors over the seeds."""
    worst, later, axes, angles, inside, claimed = [], [], [], [], [], []
    for seed in range(1, seeds + 1):
        log = Log(seed, **CASES[case], **options)
        omega, P, nis, angle, _, valid = track(name, log, late)
        claimed.append(claims(omega, P, valid, log.omega_b))
        error = np.degrees(omega - log.omega_b)
        by_axis = np.sqrt(np.mean(error**2, axis=0))
        worst.append(by_axis.max())
        later.append(np.sqrt(np.mean(error[log.t_s >= log.t_s[0] + SETTLED_S] ** 2, axis=0)).max())
        axes.append(by_axis)
        offset = angle[-1] - log.angle_z[-1]
        angles.append(abs(np.degrees(offset)))
        used = nis[nis > 0.0]
        if len(used):
            low, high = chi2.interval(0.95, 6)
            inside.append(np.mean((used > low) & (used < high)))
    rms_valid, share, wrong, beyond = np.transpose(claimed)
    return {
        "rate_worst_axis_median": round(float(np.median(worst)), 3),
        "rate_worst_axis_worst_seed": round(float(np.max(worst)), 3),
        "rate_worst_axis_median_after_2_s": round(float(np.median(later)), 3),
        "rate_called_valid_median": round(float(np.median(rms_valid)), 3),
        "rate_called_valid_worst_seed": round(float(np.max(rms_valid)), 3),
        "share_called_valid": round(float(np.mean(share)), 4),
        "valid_with_wrong_sign": round(float(np.mean(wrong)), 5),
        "valid_beyond_5_sigma": round(float(np.mean(beyond)), 5),
        "rate_by_axis_median": np.round(np.median(axes, axis=0), 3).tolist(),
        "angle_error_median_deg": round(float(np.median(angles)), 2),
        "angle_error_worst_deg": round(float(np.max(angles)), 2),
        "nis_inside_95": round(float(np.mean(inside)), 3) if inside else None,
    }


def against_bound(profile: str, seeds: int, pictures: Path | None) -> dict:
    """RMS of the Monte Carlo over the posterior Cramer-Rao bound, calibrated sensors; NEES and
    NIS.
    """
    errors, nees, nis = [], [], []
    for seed in range(1, seeds + 1):
        log = Log(seed, profile=profile, sensor=CALIBRATED)
        omega, P, values, _, still, _ = track("products-ekf", log, config=CALIBRATED_CONFIG)
        error = omega - log.omega_b
        errors.append(error)
        for k in range(600, 3000, 50):
            if not still[k]:
                nees.append(error[k] @ np.linalg.solve(P[k], error[k]))
        nis.append(values[100:].mean())
    bounds = {
        "source": SOURCE,
        "source_still": SOURCE_STILL,
        "in_use": IN_USE,
    }
    sigma = {
        k: rate_bound(log.table.layout, log.t_s, log.q_nb, log.omega_b, log.alpha_b, b)
        for k, b in bounds.items()
    }
    measured = np.degrees(np.sqrt(np.mean(np.square(errors), axis=(0, 1))))
    if pictures:
        plot_bound(
            pictures / f"bound-{profile}.png",
            log.t_s,
            sigma["in_use"],
            error,
            f"{profile}, calibrated sensors",
        )
    over = measured / np.degrees(rms(sigma["in_use"]))
    return {
        "rate_rms_calibrated": np.round(measured, 3).tolist(),
        **{f"bound_{k}": np.round(np.degrees(rms(s)), 3).tolist() for k, s in sigma.items()},
        "over_bound_in_use": np.round(over, 2).tolist(),
        "over_bound_pooled": round(
            float(np.sqrt(np.sum(measured**2) / np.sum(np.degrees(rms(sigma["in_use"])) ** 2))), 3
        ),
        "nees_mean_of_3": round(float(np.mean(nees)), 2),
        "nis_mean_of_6": round(float(np.mean(nis)), 3),
    }


def cost() -> dict:
    """Process time per sample: in a batch, by live steps, and of 64 cubes side by side."""
    log = Log(1)
    out = {}
    for name in ESTIMATORS:
        live = ESTIMATORS[name](log.table.layout)
        for k in range(600):
            live.step(k, log.t_s[k], log.readings[k])
        began = time.process_time()
        for k in range(600, 1600):
            live.step(k, log.t_s[k], log.readings[k])
        out[f"us_live_{name}"] = round((time.process_time() - began) * 1e3, 2)
        if hasattr(live, "run_batch"):
            began = time.process_time()
            live.run_batch(log.t_s[1600:], log.readings[1600:])
            out[f"us_batch_{name}"] = round((time.process_time() - began) * 1e6 / 1400, 2)
    cubes = [ProductsRate(log.table.layout) for _ in range(64)]
    began = time.process_time()
    for k in range(500, 700):
        for cube in cubes:
            cube.step(k, log.t_s[k], log.readings[k])
    out["share_of_a_core_64_cubes_at_100_hz"] = round((time.process_time() - began) / 2.0, 3)
    return out


def main() -> None:
    """All figures."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    pictures = Path(sys.argv[2]) if len(sys.argv) > 2 else None
    print(json.dumps({"bench": "rate-cost"} | cost()), flush=True)
    for case in CASES:
        print(
            json.dumps(
                {"bench": "rate", "case": case, "estimator": "products-ekf", "seeds": seeds}
                | figures("products-ekf", case, seeds)
            ),
            flush=True,
        )
    case, named = "start-while-turning", "products-ekf" + resolved.SUFFIX
    print(
        json.dumps(
            {"bench": "rate", "case": case, "estimator": named, "seeds": seeds}
            | figures("products-ekf", case, seeds, late=True)
        ),
        flush=True,
    )
    for name in ESTIMATORS:
        if name != "products-ekf":
            few = max(1, seeds // 2)
            for case in PUBLISHED:
                print(
                    json.dumps(
                        {"bench": "rate", "case": case, "estimator": name, "seeds": few}
                        | figures(name, case, few)
                    ),
                    flush=True,
                )
    for profile in (*PUBLISHED, "slow"):
        print(
            json.dumps(
                {"bench": "rate-bound", "case": profile, "seeds": seeds}
                | against_bound(profile, seeds, pictures)
            ),
            flush=True,
        )


if __name__ == "__main__":
    main()
