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
PROCESSOR = {
    "GYROFREE_CORE": "plain",
    "NPY_DISABLE_CPU_FEATURES": " ".join(__cpu_dispatch__),
}
LIBRARIES = {
    "OPENBLAS_CORETYPE": "Prescott",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F",
}
NAMES = ["table", "arm", "drive", "tilt"]


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
def with_lesser(folder: Path):
    """What is published here, and with an environment that is named."""
    said = {"here": said_by(folder, {})}

    def both(name: str, environment: dict[str, str]):
        if name not in said:
            said[name] = said_by(folder, environment)
        return said["here"], said[name]

    return both


@pytest.mark.parametrize("name", NAMES)
def test_the_core_and_numpy_publish_the_same_bytes_on_a_lesser_processor(with_lesser, name):
    here, there = with_lesser("processor", PROCESSOR)
    assert len(here[name]) > 500
    assert differences(here[name], there[name]) == {}


@pytest.mark.parametrize("name", NAMES)
def test_other_kernels_of_the_libraries_change_no_byte(with_lesser, name):
    here, there = with_lesser("libraries", LIBRARIES)
    assert differences(here[name], there[name]) == {}
