"""The container image: what its recipe copies reaches the build, and every room is copied."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def copied() -> list[str]:
    """Sources of COPY lines that come from the folder, not from another stage."""
    sources = []
    for line in (ROOT / "Dockerfile").read_text().splitlines():
        words = line.split()
        if words[:1] == ["COPY"] and not any(word.startswith("--from=") for word in words):
            sources += [word for word in words[1:-1] if not word.startswith("--")]
    return sources


def test_what_the_dockerfile_copies_is_let_through_by_dockerignore():
    allowed = {
        line[1:]
        for line in (ROOT / ".dockerignore").read_text().splitlines()
        if line.startswith("!")
    }
    assert copied()
    for source in copied():
        assert (ROOT / source).exists(), source
        assert source in allowed, f"{source}: .dockerignore keeps it from the build; add !{source}"


def packages() -> set[str]:
    return set(
        tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["scikit-build"]["wheel"][
            "packages"
        ]
    )


def test_every_package_is_in_the_image():
    assert packages() <= set(copied())


def test_every_package_is_listed():
    """An installation that is not editable has only what the list names."""
    found = {path.parent.name for path in ROOT.glob("*/__init__.py")}
    assert packages() == found - {"tests"}
