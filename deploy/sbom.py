"""What the product is made of, as CycloneDX JSON on standard output: `make sbom`.

Made from the lock file of what is installed, so it names every package with the hashes that are
accepted, and from what lies in the tree by others. No network is asked.
"""

import json
import re
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from cyclonedx.model import Property
from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentType
from cyclonedx.output.json import JsonV1Dot6
from packageurl import PackageURL

ROOT = Path(__file__).resolve().parents[1]
LOCK = ROOT / "requirements" / "runtime.txt"
VENDOR = ROOT / "dashboard" / "web" / "static" / "vendor"
SCRIPTS = {"uplot": "uplot", "maplibre": "maplibre-gl", "pmtiles": "pmtiles"}  # folder -> npm name
PINNED = re.compile(r"^([A-Za-z0-9][A-Za-z0-9._-]*)==([^\s;\\]+)(?:\s*;\s*([^\\]+?))?\s*\\?$")


@dataclass(frozen=True)
class Locked:
    """A package of a lock file."""

    name: str
    version: str
    marker: str  # of the environments that it is for; empty: all
    hashes: tuple[str, ...]  # sha256 of the files that are accepted


def locked(lock: Path = LOCK) -> list[Locked]:
    """Packages of a lock file; raises ValueError for a line that is none of one."""
    found: list[tuple[str, str, str, list[str]]] = []
    for number, line in enumerate(lock.read_text().splitlines(), 1):
        text = line.strip()
        if text.startswith("--hash=sha256:") and found:
            found[-1][3].append(text.removeprefix("--hash=sha256:").rstrip(" \\"))
        elif match := PINNED.match(text):
            found.append((match[1], match[2], match[3] or "", []))
        elif text and not text.startswith("#"):
            raise ValueError(f"{lock}:{number}: {text[:60]!r}: want NAME==VERSION and its hashes")
    return [Locked(name, version, marker, tuple(h)) for name, version, marker, h in found]


def scripts(notice: str | None = None) -> Iterator[tuple[str, str]]:
    """(npm name, version) of each script in the tree, whose versions NOTICE says."""
    text = " ".join((notice or (ROOT / "NOTICE").read_text()).split())
    for folder in sorted(path.name for path in VENDOR.iterdir()):
        before = text[: text.index(f"static/vendor/{folder}/")]
        yield SCRIPTS[folder], re.findall(r"\b(\d+\.\d+\.\d+)\b", before)[-1]


def bom() -> Bom:
    """The whole list."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    made = Bom()
    made.metadata.component = Component(
        name=project["name"],
        version=project["version"],
        type=ComponentType.APPLICATION,
        bom_ref=project["name"],
        description=project["description"],
    )
    for one in locked():
        properties = [Property(name="gyrofree:sha256", value=each) for each in one.hashes]
        if one.marker:
            properties.append(Property(name="gyrofree:marker", value=one.marker))
        made.components.add(_component("pypi", one.name, one.version, properties))
    for name, version in scripts():
        made.components.add(_component("npm", name, version, []))
    made.register_dependency(made.metadata.component, made.components)
    return made


def _component(kind: str, name: str, version: str, properties: list[Property]) -> Component:
    purl = PackageURL(kind, None, name, version)
    return Component(
        name=name,
        version=version,
        type=ComponentType.LIBRARY,
        purl=purl,
        bom_ref=str(purl),
        properties=properties,
    )


def main() -> None:
    """Print it, in a fixed order."""
    text = JsonV1Dot6(bom()).output_as_string()
    print(json.dumps(json.loads(text), indent=1, sort_keys=True))


if __name__ == "__main__":
    sys.exit(main())
