"""The core's kernels give the same bits on aarch64, run by an emulator, as on x86-64; that both
builds for x86-64 do is shown by tests/system/test_same_bits.py.

No Python is needed there: aarch64/driver.cpp calls the kernels and prints the bytes of the results.
"""

import importlib.util
import os
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CORE = ROOT / "inertial" / "core"
DRIVER = Path(__file__).with_name("aarch64") / "driver.cpp"
KERNELS = (
    "common/elementary.cpp",
    "attitude/tilt.cpp",
    "attitude/vqf.cpp",
    "rate/predict.cpp",
    "rate/correct.cpp",
    "rate/step.cpp",
    "rate/biases.cpp",
    "rate/unscented.cpp",
    "navigation/leg.cpp",
    "navigation/mechanise.cpp",
    "navigation/transition.cpp",
    "navigation/local_earth.cpp",
    "navigation/update.cpp",
)
# Those of inertial/core/CMakeLists.txt, whose order of optimisation is higher.
FLAGS = ("-std=c++20", "-O2", "-ffp-contract=off", "-fno-math-errno", "-Wall", "-Wextra")
DEFINED = ("-DEIGEN_DONT_VECTORIZE", "-DEIGEN_UNROLLING_LIMIT=0", "-DEIGEN_NO_DEBUG")
BUILDS = {
    "x86-64": ("g++", "-march=x86-64"),
    "aarch64": ("aarch64-linux-gnu-g++",),
}
PROGRAMS = ("g++", "aarch64-linux-gnu-g++", "qemu-aarch64")
MISSING = [program for program in PROGRAMS if not shutil.which(program)]
pytestmark = [
    pytest.mark.compilers,
    pytest.mark.skipif(
        bool(MISSING) and not os.environ.get("CI"),
        reason=f"no {', '.join(MISSING)}: run make compilers",
    ),
    pytest.mark.skipif(os.uname().machine != "x86_64", reason="the reference is x86-64"),
    pytest.mark.skipif(
        importlib.util.find_spec("cmeel") is None, reason="no Eigen here: run make setup"
    ),
]


def run(*command: str | Path) -> str:
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, f"{command}: {done.stderr[-4000:]}"
    return done.stdout


def build(folder: Path, compiler: tuple[str, ...]) -> Path:
    """The driver in `folder`, static. The kernels of a subject are compiled as one file each, as
    CMakeLists.txt has it: headers are parsed once.
    """
    folder.mkdir()
    (root,) = importlib.util.find_spec("cmeel").submodule_search_locations
    eigen = Path(root).with_name("cmeel.prefix") / "include" / "eigen3"
    command = [*compiler, *FLAGS, *DEFINED, f"-I{CORE}", "-isystem", eigen]
    subjects: dict[str, str] = {}
    for name in KERNELS:
        subject = name.partition("/")[0]
        subjects[subject] = subjects.get(subject, "") + f'#include "{name}"\n'
    objects = []
    for subject, text in (subjects | {"driver": f'#include "{DRIVER}"\n'}).items():
        (folder / f"{subject}.cpp").write_text(text)
        objects.append(folder / f"{subject}.o")
        run(*command, "-c", folder / f"{subject}.cpp", "-o", objects[-1])
    run(*compiler, "-static", *objects, "-o", folder / "driver")
    return folder / "driver"


@pytest.fixture(scope="module")
def drivers(tmp_path_factory):
    """Paths of the driver by name of the build."""
    folder = tmp_path_factory.mktemp("drivers")
    with ThreadPoolExecutor(2) as pool:
        made = pool.map(lambda name: build(folder / name, BUILDS[name]), BUILDS)
        return dict(zip(BUILDS, made, strict=True))


def lines_of(name: str, driver: Path) -> list[str]:
    return run(*(["qemu-aarch64"] if name == "aarch64" else []), driver).splitlines()


@pytest.mark.timeout(900)
def test_kernels_give_the_same_bits_as_on_x86_64(drivers):
    wanted, said = (lines_of(name, drivers[name]) for name in ("x86-64", "aarch64"))
    assert len(wanted) > 50_000 and len(said) == len(wanted)
    differ = [f"{a} is {b} here" for a, b in zip(wanted, said, strict=True) if a != b]
    assert not differ, f"{len(differ)} of {len(wanted)} numbers differ: {differ[:5]}"


def test_the_driver_compares_numbers_and_not_damage(drivers):
    exponents = [
        int(line.split()[1], 16) >> 52 & 0x7FF for line in lines_of("x86-64", drivers["x86-64"])
    ]
    assert 0x7FF not in exponents  # infinite, or no number
    assert len(set(exponents)) > 100
