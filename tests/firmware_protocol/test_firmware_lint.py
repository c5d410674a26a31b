"""cppcheck with its MISRA addon and clang-tidy over all of the firmware: clean, or explained in
deviations.toml.
"""

import os
import re
import shutil
import subprocess
import tomllib
import warnings
from pathlib import Path

import pytest
from support.firmware_support import FIRMWARE

DEVIATIONS = tomllib.loads((FIRMWARE / "deviations.toml").read_text(encoding="utf-8"))
FOLDERS = ("core", "drivers", "board", "port/lpc1768", "port/mps2")
INCLUDES = ["-Icore", "-Idrivers", "-Iboard", "-Iport/lpc1768"]
FILES = [
    str(path.relative_to(FIRMWARE))
    for folder in FOLDERS
    for path in sorted((FIRMWARE / folder).glob("*.c"))
]


def needs(program: str):
    return pytest.mark.skipif(
        not shutil.which(program) and not os.environ.get("CI"),
        reason=f"no {program}: run make system-packages",
    )


def findings(folder: Path) -> tuple[str, set[tuple[str, str, str]]]:
    """cppcheck's version and its (rule, file, line). It writes beside what it reads, so it has a
    copy in `folder`: a wheel that is made meanwhile would hold that, too.
    """
    shutil.copytree(FIRMWARE, folder / "firmware")
    version = subprocess.run(
        ["cppcheck", "--version"], capture_output=True, text=True, check=True, timeout=60
    ).stdout
    done = subprocess.run(
        [
            "cppcheck",
            "-j2",
            "--std=c99",
            "--enable=warning,style,performance,portability",
            "--addon=misra",
            "--quiet",
            "--suppress=checkersReport",
            "--template={id} {file} {line}",
            *INCLUDES,
            *FILES,
        ],
        cwd=folder / "firmware",
        capture_output=True,
        text=True,
        timeout=250,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    lines = [re.fullmatch(r"(\S+) (\S+) (\d+)", line) for line in done.stderr.splitlines()]
    return version.split()[-1], {match.groups() for match in lines if match}


@needs("cppcheck")
def test_cppcheck_and_misra_are_clean_or_explained(tmp_path):
    version, found = findings(tmp_path)
    allowed = {entry["rule"]: entry["files"] for entry in DEVIATIONS["deviation"]}
    unexplained = sorted(
        f"{file}:{line} {rule}"
        for rule, file, line in found
        if rule not in allowed or not {"*", file} & set(allowed[rule])
    )
    if version != DEVIATIONS["checked_with"]:
        warnings.warn(
            f"deviations.toml was made with cppcheck {DEVIATIONS['checked_with']}, this is"
            f" {version}: {len(unexplained)} findings are not in it",
            stacklevel=1,
        )
        assert not [line for line in unexplained if "misra" not in line], "\n".join(unexplained)
        return
    assert not unexplained, "\n".join(unexplained)
    assert {rule for rule, _, _ in found} == set(allowed), "a deviation that is found no more"


def test_every_deviation_says_why():
    assert all(len(entry["why"]) > 20 and entry["files"] for entry in DEVIATIONS["deviation"])


@needs("clang-tidy")
def test_clang_tidy_is_clean():
    done = subprocess.run(
        [
            "clang-tidy",
            "--quiet",
            *FILES,
            "--",
            "--target=arm-none-eabi",
            "-mcpu=cortex-m3",
            "-mthumb",
            "-ffreestanding",
            "-std=c99",
            *INCLUDES,
        ],
        cwd=FIRMWARE,
        capture_output=True,
        text=True,
        timeout=250,
    )
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-500:]
