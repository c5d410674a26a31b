"""The core in C++: clang-tidy finds nothing, and neither do the sanitizers while its tests run."""

import importlib.util
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CORE = ROOT / "inertial" / "core"
TESTS = sorted(
    str(path)
    for path in (ROOT / "tests" / "inertial").glob("test_*.py")
    if path.name != Path(__file__).name
    and ("inertial.core" in path.read_text() or "import core" in path.read_text())
)
pytestmark = [
    pytest.mark.compilers,
    pytest.mark.skipif(
        importlib.util.find_spec("nanobind") is None or importlib.util.find_spec("cmeel") is None,
        reason="the packages of requirements/build.txt are not here: run make setup",
    ),
]


def needs(*programs: str):
    missing = [program for program in programs if not shutil.which(program)]
    return pytest.mark.skipif(
        bool(missing) and not os.environ.get("CI"),
        reason=f"no {', '.join(missing)}: run make system-packages",
    )


def cmake(*arguments: str | Path) -> None:
    """CMake of the environment or of the machine; ninja likewise."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(
        ["cmake", *arguments],
        env=os.environ | {"PATH": path},
        capture_output=True,
        text=True,
        timeout=900,
    )
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]


def configure(folder: Path, *options: str) -> None:
    cmake(
        "-S", CORE, "-B", folder, "-G", "Ninja", f"-DPython_EXECUTABLE={sys.executable}", *options
    )


@pytest.mark.timeout(1800)
@needs("clang-tidy", "clang++")
def test_clang_tidy_is_clean(tmp_path):
    """The kernels of each subject, as the one file that they are compiled as; what binds them to
    Python is left to the compiler's own warnings.
    """
    configure(tmp_path, "-DCMAKE_CXX_COMPILER=clang++", "-DCMAKE_EXPORT_COMPILE_COMMANDS=ON")

    def findings(source: Path) -> str:
        done = subprocess.run(
            [
                "clang-tidy",
                "--quiet",
                f"--config-file={CORE / '.clang-tidy'}",
                "-p",
                tmp_path,
                source,
            ],
            capture_output=True,
            text=True,
            timeout=900,
        )
        return "" if done.returncode == 0 else done.stdout + done.stderr

    sources = sorted((tmp_path / "CMakeFiles" / "_core_plain.dir" / "Unity").glob("*.cxx"))
    assert sources
    with ThreadPoolExecutor(2) as pool:
        assert "".join(pool.map(findings, sources)) == ""


@pytest.mark.timeout(1800)
@needs("g++")
def test_the_sanitizers_find_nothing_while_the_tests_of_the_core_run():
    folder = ROOT / "build" / "core-sanitised"
    configure(folder, "-DCMAKE_CXX_COMPILER=g++", "-DCMAKE_BUILD_TYPE=Debug", "-DSANITIZE=ON")
    cmake("--build", folder, "--target", "_core_plain")
    (module,) = folder.glob("_core_plain.*.so")
    runtimes = [
        subprocess.run(
            ["g++", f"-print-file-name={name}"], capture_output=True, text=True, check=True
        ).stdout.strip()
        for name in ("libasan.so", "libubsan.so")
    ]
    path = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "support.sanitised_core",
            module,
            "-q",
            "-x",
            "-p",
            "no:cacheprovider",
        ]
        + TESTS,
        cwd=ROOT,
        env=os.environ
        | {
            "PYTHONPATH": path,
            "GYROFREE_EXAMPLES": "few",
            "LD_PRELOAD": ":".join(runtimes),
            "ASAN_OPTIONS": "detect_leaks=0",  # Python's own are many
            "UBSAN_OPTIONS": "print_stacktrace=1",
        },
        capture_output=True,
        text=True,
        timeout=900,
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-4000:]
    assert TESTS and " passed" in done.stdout
