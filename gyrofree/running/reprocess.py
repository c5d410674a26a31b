"""One session of a reprocessing run: picklable, so that it runs in this process, in a pool, or on a
cluster.
"""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from estimator.settings import EstimatorSettings


def score_session(settings: EstimatorSettings, path: Path) -> list[dict[str, Any]]:
    """Rows of sessions.replay.reprocess.COLUMNS for every boot and estimator of a recording; raises
    what reading raises.
    """
    from estimator.pipeline import Pipeline
    from sessions.recording.manifest import read_manifest
    from sessions.replay.rerun import estimates_again, write_session
    from sessions.report.analysis import analyse
    from sessions.report.data import load_run

    manifest = read_manifest(path.parent)
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as scratch:
        again = estimates_again(path, Pipeline(settings))
        new = (
            write_session(Path(scratch), manifest.id, again, manifest.note, manifest.configuration)
            / "recording.mcap"
        )
        for device in manifest.devices:
            boots: tuple[int, ...] = ()
            try:
                boots = load_run(new, device).boots
            except ValueError:
                continue  # a device without samples: the recorder itself, a note
            for boot in boots:
                rows += _rows(manifest.id, analyse(load_run(new, device, boot), manifest))
    return rows


def _rows(session: str, found: Any) -> list[dict[str, Any]]:
    run = found.run
    common = {
        "session": session,
        "device": run.device,
        "boot": run.epoch,
        "start_utc_s": run.start_utc_s,
        "seconds": run.seconds,
        "lost_samples": int(run.link.get("lost_samples", 0)),
        "problem": "",
    }
    if found.cube is not None and found.cube.bias_b is not None:
        common |= {
            f"accel_bias_{axis}_mps2": float(found.cube.bias_b[k]) for k, axis in enumerate("xyz")
        }
    rows = []
    for rate, result in zip(run.rates, found.rates, strict=True):
        row = common | {
            "estimator": rate.name,
            "samples": len(rate.t),
            "angle_error_rad": result.angle_error,
        }
        if result.rms is not None and np.isfinite(result.rms).all():
            row |= {f"rate_rms_{axis}_radps": float(result.rms[k]) for k, axis in enumerate("xyz")}
        if result.fit is not None:
            row["scale_factor"] = result.fit.scale_factor
        if result.nis is not None:
            row["nis_per_dof"] = result.nis.mean
        rows.append(row)
    return rows or [
        common | {"estimator": nav.name, "samples": len(nav.t)} for nav in run.navigation
    ]
