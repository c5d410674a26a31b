"""The same bits from both builds of the core: a drive through filters of every kind."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from inertial import core
from inertial.navigation.batch import run_filters
from inertial.navigation.smoother import smooth_drive
from inertial.simulation.drive import simulate

ROOT = Path(__file__).resolve().parents[2]
NAMES = ("kf-scale", "huber-nhc", "fpe-fuzzy", "mhe-robust")


def digest() -> str:
    """Of all that the filters say of a simulated drive with gross fixes."""
    drive = simulate(3, "C", 100.0)
    said = hashlib.sha256()
    for run in run_filters(drive.imu, drive.fixes, NAMES).values():
        for name in ("status", "nis", "y", "sigma", "left", "P"):
            said.update(run.rows[name].tobytes())
        said.update(run.x["C_nb"].tobytes() + run.x["v_n"].tobytes())
    said.update(smooth_drive(drive.imu, drive.fixes).P.tobytes())
    return said.hexdigest()


@pytest.mark.skipif(core.BUILD == "plain", reason="this processor has but one build")
def test_both_builds_give_the_same_bits() -> None:
    code = "from tests.inertial.test_navigation_bits import digest; print(digest())"
    plain = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={**os.environ, "GYROFREE_CORE": "plain"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert plain.stdout.strip() == digest()
