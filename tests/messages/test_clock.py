"""Elapsed time beside a wall clock that is set under a real process."""

import json
import subprocess
import sys
import time

import pytest
from support.wall_clock import YEAR_S, WallClock

from messages.clock import Moment, Step

WATCH = """
import json, sys, time
from messages.clock import Clock, Moment
clock, moment = Clock(), Moment.now()
print(json.dumps(clock.now_ns()), flush=True)
for line in sys.stdin:
    step = clock.look()
    print(json.dumps([clock.now_ns(), clock.at_ns(time.monotonic_ns()), time.time_ns(),
                      moment.age_s, clock.offset_ns, step]), flush=True)
"""


@pytest.mark.parametrize("offset_s", [-YEAR_S, YEAR_S, -3.0])
def test_a_wall_clock_that_is_set_moves_nothing(tmp_path, offset_s):
    wall = WallClock(tmp_path)
    with subprocess.Popen(
        [sys.executable, "-c", WATCH],
        env=wall.environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:

        def ask() -> list:
            process.stdin.write("\n")
            process.stdin.flush()
            return json.loads(process.stdout.readline())

        begin_ns = json.loads(process.stdout.readline())
        assert ask()[4:] == [0, None]
        wall.set(offset_s)
        began = time.monotonic()
        now_ns, at_ns, wall_ns, age_s, offset_ns, step = ask()
        passed_s = time.monotonic() - began + 10.0
        assert 0 <= now_ns - begin_ns < 60e9 + passed_s * 1e9
        assert abs(at_ns - now_ns) < 50e6
        assert 0.0 <= age_s < 60.0 + passed_s
        assert wall_ns - now_ns == pytest.approx(offset_s * 1e9, abs=0.1e9)
        assert offset_ns == pytest.approx(offset_s * 1e9, abs=0.1e9)
        assert step[1] == pytest.approx(offset_s * 1e9, abs=0.1e9)
        assert ("back" if offset_s < 0 else "forward") in str(Step(*step))
        assert ask()[4:] == [offset_ns, None]  # told once
        wall.set(0.0)
        assert abs(ask()[4]) < 0.1e9
        process.stdin.close()


def test_a_moment_of_another_boot_is_judged_by_the_wall_clock():
    now = Moment.now()
    other = Moment("another", now.elapsed_ns, now.wall_ns - 7_000_000_000)
    assert other.age_s == pytest.approx(7.0, abs=2.0)
    assert Moment("another", 0, now.wall_ns + 10**18).age_s == 0.0
    assert Moment.of(list(now)) == now
    assert Moment.of(["x"]) is Moment.of(None) is Moment.of([1, "y", 2]) is None
