"""inertial/ is a plain library: it runs where nothing of the product's services is installed."""

import pkgutil
import subprocess
import sys
from pathlib import Path

import inertial

ROOT = Path(inertial.__file__).resolve().parents[1]
BLOCKED = ("zenoh", "pydantic", "google", "fastapi", "viser", "mcap", "typer", "serial")
ROOMS = ("messages", "estimator", "gateway", "logs", "sessions", "dashboard", "gyrofree")
PROGRAM = """
import importlib, sys


class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {blocked!r}:
            raise ImportError(f"{{name}} is not installed")


sys.meta_path.insert(0, Refuse())
sys.path.insert(0, {root!r})
for name in {modules!r}:
    importlib.import_module(name)
print(len(sys.modules))
"""


def modules() -> list[str]:
    return ["inertial"] + [
        m.name
        for m in pkgutil.walk_packages(inertial.__path__, "inertial.")
        if "._core_" not in m.name
    ]


def test_every_module_imports_without_the_services():
    program = PROGRAM.format(blocked=BLOCKED + ROOMS, root=str(ROOT), modules=modules())
    done = subprocess.run(
        [sys.executable, "-P", "-c", program], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr


def test_the_first_page_names_every_part():
    parts = {m.name for m in pkgutil.iter_modules(inertial.__path__)}
    told = {line.split()[0] for line in inertial.__doc__.splitlines() if line.startswith("    ")}
    missing = parts - told
    assert not missing, f"say in inertial/__init__.py what is in {sorted(missing)}"
