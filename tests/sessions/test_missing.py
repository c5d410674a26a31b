"""The certificate counts every sample that is missing, also where no line counted it."""

import csv
import json
import random
import subprocess
import sys
from pathlib import Path

import pytest

from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import parse
from sessions.recording.certificate import certify
from sessions.recording.keys import KeyState
from sessions.recording.manifest import KeyCount

KEY = "p/cube/accel"


def batches(
    count: int = 200,
    n: int = 5,
    lost: dict[int, int] | None = None,
    hole: dict[int, float] | None = None,
) -> list[pb.AccelBatch]:
    """A board at 100 Hz; before batch k `lost[k]` samples are missing by their index, and the board
    took none for `hole[k]` s though it counted on.
    """
    index, t_us, found = 0, 5_000_000, []
    for k in range(count):
        missing = (lost or {}).get(k, 0)
        index, t_us = (
            index + missing,
            t_us + 10_000 * missing + round((hole or {}).get(k, 0.0) * 1e6),
        )
        header = pb.Header(device="cube", sequence=k + 1, epoch=3, device_us=t_us, run=9)
        found.append(
            pb.AccelBatch(
                header=header, first_index=index, period_s=0.01, axes=12, counts=[1] * (12 * n)
            )
        )
        index, t_us = index + n, t_us + 10_000 * n
    return found


def missing(messages: list[pb.AccelBatch]) -> int:
    state = KeyState(1, parse(KEY))
    for message in messages:
        state.publish_time(message.SerializeToString())
    certificate = certify({KEY: state.count}, {})["cube"]
    assert certificate.complete == (certificate.missing_samples == 0)
    return certificate.missing_samples


def test_nothing_is_missing_of_a_whole_recording():
    assert missing(batches()) == 0
    shaken = batches()
    draw = random.Random(1)
    for message in shaken:
        message.header.device_us += draw.randrange(-4000, 4000)
    assert missing(shaken) == 0
    reboot = batches(20) + batches(20)
    for message in reboot[20:]:
        message.header.epoch = 4
    assert missing(reboot) == 0


@pytest.mark.parametrize("seed", range(5))
def test_what_is_missing_by_index_is_counted(seed):
    draw = random.Random(seed)
    lost = {draw.randrange(1, 200): draw.randrange(1, 300) for _ in range(5)}
    assert missing(batches(n=draw.randrange(1, 9), lost=lost)) == sum(lost.values())


def test_a_second_that_the_board_did_not_sample_is_missing():
    assert missing(batches(hole={77: 1.0})) == 100


@pytest.mark.parametrize("hole", ["", "second", "tenth"])
def test_an_imported_log_with_a_hole_is_not_complete(tmp_path, hole):
    log = tmp_path / "log.csv"
    with log.open("w", newline="") as stream:
        rows = csv.writer(stream)
        rows.writerow(["t_s", "fx_mps2", "fy_mps2", "fz_mps2", "wx_radps", "wy_radps", "wz_radps"])
        for k in range(1000):
            if (hole == "second" and 400 <= k < 500) or (hole == "tenth" and k % 10 == 5):
                continue
            rows.writerow([f"{k / 100:.2f}", 0.01, 0.02, -9.8, 0.001, 0.0, 0.0])
    done = subprocess.run(
        [sys.executable, "-P", "-m", "gyrofree", "import", str(log)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    (path,) = Path(tmp_path).rglob("session.json")
    (certificate,) = json.loads(path.read_text())["certificate"].values()
    assert certificate["missing_samples"] == (100 if hole else 0)
    assert certificate["complete"] == (not hole)


def test_a_word_on_the_line_that_comes_late_is_no_time_without_a_reader():
    keys = {
        "t/cube/accel": KeyCount(messages=100),
        "t/cube/link": KeyCount(messages=3, dark_s=0.8),
        "t/receiver/link": KeyCount(messages=3, dark_s=0.8),
    }
    said = certify(keys, {})
    assert said["cube"].complete and said["cube"].dark_s == 0.0
    assert not said["receiver"].complete  # without samples its words are all that tells
