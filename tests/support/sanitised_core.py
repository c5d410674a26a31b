"""pytest with another build of the core in place of the installed one."""

import importlib.util
import os
import sys

import pytest

NAME = "inertial.core._core_plain"


def main(path: str, arguments: list[str]) -> int:
    """Load the module at `path` under the name of the plain core; pytest with `arguments`."""
    os.environ["GYROFREE_CORE"] = "plain"
    spec = importlib.util.spec_from_file_location(NAME, path)
    sys.modules[NAME] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sys.modules[NAME])
    from inertial import core

    assert core.native.__file__ == path, f"{core.native.__file__} is in use, not {path}"
    return pytest.main(arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
