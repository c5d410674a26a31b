"""Whatever the product imports from outside is named among its dependencies.

A package that is there only because another one brings it goes away when that other one changes.
"""

import re
import sys
import tomllib
from collections.abc import Iterable
from importlib.metadata import packages_distributions

import pytest

from tests.system.test_architecture import MAY_IMPORT, ROOT, imports

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
OPTIONAL = {name: PROJECT["optional-dependencies"][name] for name in ("board", "scale")}


def names(requirements: Iterable[str]) -> set[str]:
    """The bare names of requirements, in the one spelling that compares."""
    return {plain(re.split(r"[\s<>=!~;\[]", each)[0]) for each in requirements}


def plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def asked_for(room: str) -> dict[str, str]:
    """Every top package from outside that a room imports, with one file that does."""
    inside = {*MAY_IMPORT, *sys.stdlib_module_names}
    return {
        name.split(".")[0]: str(path.relative_to(ROOT))
        for path in sorted((ROOT / room).rglob("*.py"))
        for name in imports(path)
        if name.split(".")[0] not in inside
    }


@pytest.mark.parametrize("room", sorted(MAY_IMPORT))
def test_every_import_from_outside_is_a_named_dependency(room: str) -> None:
    named = names(PROJECT["dependencies"]).union(*map(names, OPTIONAL.values()))
    brings = packages_distributions()
    missing = {
        package: path
        for package, path in asked_for(room).items()
        if not named & {plain(each) for each in brings.get(package, [package])}
    }
    assert not missing, f"{room}: imported but not named in pyproject.toml: {missing}"
