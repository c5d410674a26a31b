"""The container image: what its recipe copies reaches the build, and every room is copied."""

import tomllib
from pathlib import Path

import yaml

from gyrofree.config import load
from gyrofree.running.watch import SERVICES

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


def compose() -> dict:
    return yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]


def test_the_containers_are_the_services_of_up_and_a_board():
    """Each as `up` starts it, with its sign of life; besides them the simulated board alone."""
    run = {name: words["command"][0] for name, words in compose().items()}
    assert sorted(set(run.values()) - {"simulate"}) == sorted(SERVICES)
    assert len(run) == len(SERVICES) + 1 and run["board"] == "simulate"
    for name, words in compose().items():
        if name != "board":
            assert words["healthcheck"]["test"] == ["CMD", "gyrofree", "doctor", "--health", name]


def test_what_the_containers_are_configured_to_write_is_kept_in_a_volume():
    settings = load(ROOT / "deploy" / "gyrofree.toml")
    written = {
        "gateway": settings.gateway.journal,
        "estimator": settings.estimator.journal,
        "recorder": settings.recorder.root,
        "procedures": settings.procedures.root,
        "dashboard": settings.dashboard.users,
    }
    volumes = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["volumes"]
    for name, path in written.items():
        kept = [entry.split(":")[:2] for entry in compose()[name]["volumes"]]
        inside = [volume for volume, at in kept if Path(at) in (path, *Path(path).parents)]
        assert inside and set(inside) <= set(volumes), (name, path)
