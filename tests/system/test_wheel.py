"""The wheel: all that the packages need is in it, and it runs where there is no compiler."""

import importlib.util
import subprocess
import sys
import tomllib
import urllib.request
import venv
import zipfile
from pathlib import Path

import pytest
from support.stack import RunningDemo

ROOT = Path(__file__).resolve().parents[2]
CORE_SOURCES = {
    ".cpp",
    ".hpp",
    ".cmake",
    ".txt",
}  # of inertial/core: what is built takes their place
pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("scikit_build_core") is None,
    reason="the packages of requirements/build.txt are not here: run make setup",
)


def pip(python: str | Path, *arguments: str | Path) -> None:
    done = subprocess.run(
        [python, "-m", "pip", "--disable-pip-version-check", *arguments],
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=280,
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dist")
    pip(sys.executable, "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", folder, ".")
    (path,) = folder.glob("gyrofree-*.whl")
    return path


def wanted() -> set[str]:
    """Files of the packages under version control, the core's sources left out."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    packages = project["tool"]["scikit-build"]["wheel"]["packages"]
    listed = subprocess.run(
        ["git", "ls-files", *packages], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    return {
        name
        for name in listed
        if not (name.startswith("inertial/core/") and Path(name).suffix in CORE_SOURCES)
    }


def test_every_file_of_the_packages_is_in_it(wheel):
    held = set(zipfile.ZipFile(wheel).namelist())
    assert wanted() - held == set()
    more = {name for name in held - wanted() if ".dist-info/" not in name}
    assert {name.rpartition("/")[2].partition(".")[0] for name in more} == {
        "_core_plain",
        "_core_v3",
        "_cycles",
    }


def test_it_installs_and_runs_without_a_compiler(wheel, tmp_path):
    """A new environment with the pinned packages, and nothing but its own programs on the PATH."""
    venv.create(tmp_path / "env", with_pip=True)
    python = tmp_path / "env" / "bin" / "python"
    packages = ROOT / "requirements" / "runtime.txt"
    pip(python, "install", "--no-deps", "--no-compile", "--require-hashes", "-r", packages)
    pip(python, "install", "--no-deps", "--no-index", wheel)
    alone = {"PATH": str(python.parent), "HOME": str(tmp_path)}
    with RunningDemo(tmp_path / "demo", python=python, environment=alone) as demo:
        with urllib.request.urlopen(demo.link, timeout=30) as page:
            assert b"gyrofree" in page.read()
        demo.wait_for("estimating", 60.0)
