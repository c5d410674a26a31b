"""The same session gives the same bytes, whatever the processor can do.

One process sees the machine as it is. The other is told that it can do less: the core's build for
any x86-64, numpy without its wide loops, another kernel of BLAS, the C library without AVX2 and
FMA. What a processor's abilities decide is then different, and what is published must not be.
"""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest
from numpy._core._multiarray_umath import __cpu_dispatch__
from support.same_bits import TYPES, Published
from support.same_bits_sessions import sessions

ROOT = Path(__file__).resolve().parents[2]
LESSER = {
    "core": {"GYROFREE_CORE": "plain"},
    "numpy": {"NPY_DISABLE_CPU_FEATURES": " ".join(__cpu_dispatch__)},
    "BLAS": {"OPENBLAS_CORETYPE": "Prescott"},
    "C library": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F"},
}


def said_by(folder: Path, environment: dict[str, str]) -> dict[str, list[Published]]:
    """What a process with this environment publishes on the sessions of `folder`."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith("OPENBLAS_")}
    path = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
    subprocess.run(
        [sys.executable, "-P", "-m", "support.same_bits", folder / "inputs", folder / "outputs"],
        env=kept | {"PYTHONPATH": path} | environment,
        check=True,
        timeout=280,
    )
    said = pickle.loads((folder / "outputs").read_bytes())
    return {name: [Published(*row) for row in rows] for name, rows in said.items()}


def differing_fields(one: Published, other: Published) -> set[str]:
    """Names of the fields in which two payloads of a topic differ."""
    a, b = (TYPES[p.topic].FromString(p.payload) for p in (one, other))
    names = {f.name for f in a.DESCRIPTOR.fields}
    return {name for name in names if repr(getattr(a, name)) != repr(getattr(b, name))}


def differences(here: list[Published], there: list[Published]) -> dict[str, tuple[int, set[str]]]:
    """By topic and estimator: how many messages differ, in which fields."""
    out: dict[str, tuple[int, set[str]]] = {}
    for one, other in zip(here, there, strict=True):
        if one != other:
            count, fields = out.get(f"{one.topic}/{one.estimator}", (0, set()))
            out[f"{one.topic}/{one.estimator}"] = count + 1, fields | differing_fields(one, other)
    return out


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("same-bits")
    made = {name: tuple(session) for name, session in sessions(folder).items()}
    (folder / "inputs").write_bytes(pickle.dumps(made))
    return folder


@pytest.fixture(scope="module")
def here(folder: Path) -> dict[str, list[Published]]:
    return said_by(folder, {})


@pytest.fixture(scope="module")
def there(folder: Path) -> dict[str, list[Published]]:
    return said_by(folder, {k: v for less in LESSER.values() for k, v in less.items()})


@pytest.mark.parametrize("name", ["table", "arm", "drive", "tilt"])
def test_a_lesser_processor_publishes_the_same_bytes(here, there, name):
    assert len(here[name]) > 500
    assert differences(here[name], there[name]) == {}
