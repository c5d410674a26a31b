"""The container image: what its recipe copies reaches the build, and every room is copied."""

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
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


SITES = ("lab", "office")


def file_of(place: str) -> dict:
    return yaml.safe_load((ROOT / "deploy" / f"compose.{place}.yml").read_text())


@pytest.mark.parametrize("place", SITES)
def test_no_container_of_a_site_has_more_than_it_needs(place):
    words = file_of(place)
    for name, service in words["services"].items():
        assert service["user"] == "10001:10001" and service["read_only"], name
        assert service["cap_drop"] == ["ALL"] and service["init"], name
        assert service["security_opt"] == ["no-new-privileges:true"], name
        kept = [entry.split(":")[0] for entry in service.get("volumes", [])]
        assert {one for one in kept if one[0] != "."} <= set(words["volumes"]), name
        assert all(
            port.startswith("127.0.0.1:") or ":7447" in port for port in service.get("ports", [])
        )
    open_ports = [p for s in file_of("lab")["services"].values() for p in s.get("ports", [])]
    assert open_ports == ["127.0.0.1:${GYROFREE_PORT:-8080}:8080"]  # it calls, nobody calls it
    long_lived = {"lab": "bench", "office": "office"}[place]
    assert words["services"][long_lived]["healthcheck"]["test"][1:3] == ["gyrofree", "doctor"]


@pytest.mark.parametrize("place", SITES)
def test_podman_compose_takes_the_file(place, tmp_path):
    """It asks for podman's version before it reads anything, and for nothing else."""
    tool = shutil.which(
        "podman-compose", path=f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    )
    if tool is None:
        pytest.skip("podman-compose is not installed: make dev")
    file = ROOT / "deploy" / f"compose.{place}.yml"
    podman = tmp_path / "podman"
    podman.write_text("#!/bin/sh\necho 'podman version 4.3.1'\n")
    podman.chmod(0o755)
    done = subprocess.run(
        [tool, "--file", str(file), "config"],
        env=os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert yaml.safe_load(done.stdout)["services"].keys() <= file_of(place)["services"].keys()


def step(place: str, service: str, folder: Path) -> tuple[str, list[str]]:
    """The script of a one-shot step, its folders moved below `folder`."""
    words = file_of(place)["services"][service]
    assert words["entrypoint"] == ["sh", "-euc"]
    text = words["command"][0].replace("$$", "$")
    text = text.replace("/data/", f"{folder}/").replace("/etc/gyrofree/", f"{ROOT}/deploy/")
    return text, words["entrypoint"]


def test_the_first_step_of_a_lab_makes_a_site_that_up_would_run(tmp_path):
    (tmp_path / "site").mkdir()
    script, (shell, *options) = step("lab", "site", tmp_path)
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    environment = os.environ | {"SITE": "lab", "PATH": path, "PYTHONPATH": str(ROOT)}
    for _ in range(2):  # again: it is left as it is
        done = subprocess.run(
            [shell, *options, script], env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        made = (tmp_path / "site" / "gyrofree.toml").read_bytes()
    settings = load(tmp_path / "site" / "gyrofree.toml")
    assert made == (tmp_path / "site" / "gyrofree.toml").read_bytes()
    assert settings.bus.prefix == "lab" and (settings.bus.tls / "simulator.pem").is_file()
    assert [device.name for device in settings.gateway.devices] == ["cube"]
    assert settings.recorder.root == Path("/data/sessions") and settings.log.format == "json"
    mounted = {v.split(":")[1] for v in file_of("lab")["services"]["bench"]["volumes"]}
    written = (
        settings.gateway.journal,
        settings.estimator.journal,
        settings.recorder.root,
        settings.procedures.root,
        settings.dashboard.users,
        settings.alarms.state,
    )
    for each in written:
        assert any(Path(at) in (each, *Path(each).parents) for at in mounted), each


def test_an_offices_settings_are_good(tmp_path):
    settings = load(ROOT / "deploy" / "office.toml")
    mounted = {v.split(":")[1] for v in file_of("office")["services"]["office"]["volumes"]}
    for each in (settings.recorder.root, settings.dashboard.users, settings.alarms.state):
        assert any(Path(at) in (each, *Path(each).parents) for at in mounted), each
    script, _ = step("office", "join", tmp_path)
    assert "site join /run/secrets/invitation" in script
