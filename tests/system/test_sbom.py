"""The list of parts names what the lock names, no more and no less, and is CycloneDX."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("cyclonedx")

ROOT = Path(__file__).resolve().parents[2]


def load():
    spec = importlib.util.spec_from_file_location("sbom", ROOT / "deploy" / "sbom.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["sbom"] = module
    spec.loader.exec_module(module)
    return module


def test_the_list_is_the_lock_and_the_scripts_in_the_tree():
    done = subprocess.run(
        [sys.executable, "-P", str(ROOT / "deploy" / "sbom.py")], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert said["bomFormat"] == "CycloneDX" and said["specVersion"] == "1.6"
    assert said["metadata"]["component"]["name"] == "gyrofree"
    text = (ROOT / "requirements" / "runtime.txt").read_text()
    pinned = sorted(line.split()[0].rstrip(";") for line in text.splitlines() if "==" in line[:60])
    pinned = [one for one in pinned if not one.startswith("--")]
    python = [c for c in said["components"] if c["purl"].startswith("pkg:pypi/")]
    assert sorted(f"{c['name']}=={c['version']}" for c in python) == pinned
    hashes = sorted(h for c in python for h in values(c, "gyrofree:sha256"))
    assert hashes == sorted(p.split()[0] for p in text.split("--hash=sha256:")[1:])
    others = {c["name"]: c["version"] for c in said["components"] if c not in python}
    assert others == {"uplot": "1.6.32", "maplibre-gl": "6.17.0", "pmtiles": "4.5.0"}
    refs = [c["bom-ref"] for c in said["components"]]
    assert len(set(refs)) == len(refs) and "://" not in "".join(refs)


def values(component, name):
    return [p["value"] for p in component.get("properties", []) if p["name"] == name]


def test_a_line_that_pins_nothing_is_not_passed_over(tmp_path):
    lock = tmp_path / "lock.txt"
    lock.write_text("rich==14.3.4 \\\n    --hash=sha256:00\nnumpy>=2\n")
    with pytest.raises(ValueError, match=":3: 'numpy>=2': want NAME==VERSION"):
        load().locked(lock)
