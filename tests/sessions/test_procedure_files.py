"""Procedures, tables and motions as files; runs as journals; batches of units."""

import math
import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.procedures import STILL, Answers, start

from sessions.procedure import library
from sessions.procedure.batch import COLUMNS, Cell, Unit, marked, remarks
from sessions.procedure.driven.description import TableError, described
from sessions.procedure.driven.left_alone import watch
from sessions.procedure.driven.table import TextTable
from sessions.procedure.library import ProcedureError, find, names, of_text
from sessions.procedure.model import DEG
from sessions.procedure.profile_file import profile_of
from sessions.procedure.run import Journal, unfinished


@pytest.mark.parametrize("name", names())
def test_every_shipped_procedure_is_sound(name):
    plan = find(name)
    assert plan.steps and plan.least_seconds > 0 and len(plan.sha256) == 64


def test_a_staircase_goes_up_and_down_again():
    rates = [round(s.target / DEG) for s in find("staircase").steps if s.kind == "rate"]
    assert rates == [40, 80, 120, 160, 200, 240, 200, 160, 120, 80, 40]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (STILL + "secnds = 2\n", "x.toml:5: step 1 (still) has no key 'secnds'; did you mean"),
        (STILL + '[[steps]]\nkind = "rat"\n', "x.toml:5: step 2: kind 'rat'; did you mean 'rate'?"),
        (STILL.replace("1\n", "-1\n"), "x.toml:4: step 1 (still) seconds = -1"),
        (STILL + "[limits.rate_rms_z]\nmax = 1\n", "did you mean rate_rms_z_dps"),
        (STILL + "[limits.rate_bias_dps]\nmin = 2\nmax = 1\n", "nothing would pass"),
        ("title = ", "not TOML"),
        ('title = "a"\nsteps = []\n', "steps"),
    ],
)
def test_a_fault_is_told_with_place_and_nearest_name(text, said):
    with pytest.raises(ProcedureError, match="x.toml") as error:
        of_text(text, "x", "x.toml")
    assert said in str(error.value)


@settings(max_examples=200, deadline=None)
@given(st.text(max_size=60), st.sampled_from(["title", "kind", "seconds", "[[steps]]", "[limits]"]))
def test_no_text_is_taken_or_refused_but_by_a_sentence(text, word):
    for given_text in (text, f"{word} = {text}", STILL + text):
        try:
            assert of_text(given_text, "x").steps
        except ProcedureError as error:
            assert str(error)


def test_a_journal_cut_off_anywhere_gives_what_was_written_before(tmp_path):
    journal = Journal.begin(tmp_path, start())
    journal.add("step", k=0)
    journal.add("spoilt", k=0, reason="it shook")
    journal.add("step", k=0)
    data = journal.path.read_bytes()
    first = data.index(b"\n") + 1
    for length in range(first, len(data) + 1):
        journal.path.write_bytes(data[:length])
        found = unfinished(tmp_path)["cube"]
        lines = data[:length].count(b"\n") - 1
        assert found.run.steps[0].attempts == (0, 1, 1, 2)[lines]
        assert found.run.steps[0].spoilt == (0, 0, 1, 1)[lines]
        found.add("closed")  # goes on, on a line of its own
        assert unfinished(tmp_path) == {}


def test_a_table_is_spoken_to_in_its_own_words():
    replies = {"*IDN?": "gyrofree,simulated rate table", "SENS:RATE?": "-90.0000"}
    line = Answers(lambda text: replies.get(text, "OK"))
    table = TextTable(described("simulated"), line.path)
    table.take()
    table.set_rate(-90.0 * DEG, 45.0 * DEG)
    assert table.rate() == pytest.approx(-90.0 * DEG)
    table.stop()
    table.release()
    assert line.lines == [
        "*IDN?",
        "SYST:REM",
        "SYST:WATC 3.0000",
        "SOUR:ACC 45.0000",
        "SOUR:RATE -90.0000",
        "SENS:RATE?",
        "OUTP:STOP",
        "SYST:LOC",
    ]
    with pytest.raises(TableError, match="it can 720"):
        table.set_rate(800.0 * DEG)
    with pytest.raises(TableError):
        table.set_rate(math.nan)


DRIVER = """
import sys, time
from sessions.procedure.driven.description import described
from sessions.procedure.driven.table import TextTable
table = TextTable(described("simulated"), sys.argv[1])
table.take()
table.set_rate(1.0)
print("turns", flush=True)
time.sleep(60)
"""


def test_a_table_whose_driver_is_killed_is_stopped_by_the_guard():
    replies = {"*IDN?": "gyrofree,simulated rate table", "SENS:RATE?": "57.3"}
    line = Answers(lambda text: replies.get(text, "OK"))
    words = [sys.executable, "-P", "-c", DRIVER, line.path]
    with subprocess.Popen(words, stdout=subprocess.PIPE, start_new_session=True) as driver:
        assert driver.stdout.readline() == b"turns\n"
        assert "OUTP:STOP" not in line.lines
        os.killpg(driver.pid, signal.SIGKILL)
    end = time.monotonic() + 30.0
    while "OUTP:STOP" not in line.lines:
        assert time.monotonic() < end, line.lines
        time.sleep(0.05)


def test_a_driver_that_hangs_and_one_that_lets_go():
    line = Answers(lambda _: "OK")
    table = TextTable(described("simulated"), line.path)
    source, driver = os.pipe()
    done: list[int] = []
    guard = threading.Thread(target=lambda: done.append(watch(source, table, 0.2)))
    guard.start()
    end = time.monotonic() + 30.0
    while "OUTP:STOP" not in line.lines and time.monotonic() < end:
        time.sleep(0.05)
    os.write(driver, b"q")
    guard.join(10.0)
    assert done == [0] and line.lines == ["OUTP:STOP"]


@pytest.mark.parametrize("reply", [None, "ERR busy", "nan", "\x00\xff" * 9])
def test_a_table_that_answers_something_else_is_named(reply):
    table = TextTable(described("simulated"), Answers(lambda _: reply).path)
    for order in (table.take, table.rate, table.stop):
        with pytest.raises(TableError, match="simulated rate table"):
            order()


def test_a_table_that_is_not_there_is_named(tmp_path):
    with pytest.raises(TableError, match="none"):
        TextTable(described("simulated"), str(tmp_path / "none")).take()
    with pytest.raises(TableError, match="want a file, or one of simulated"):
        described(tmp_path / "none.toml")


def test_motions_from_files(tmp_path):
    csv, toml = tmp_path / "a.csv", tmp_path / "b.toml"
    csv.write_text("t_s,rate_dps\n0,0\n1,100\n3,100\n4,0\n")
    toml.write_text(
        "".join(f"[[pieces]]\nseconds={s}\nto_dps={r}\n" for s, r in ((1, 100), (2, 100), (1, 0)))
    )
    first, second = profile_of(str(csv)), profile_of(str(toml))
    assert first.seconds == second.seconds == 4.0
    assert first.max_rate == pytest.approx(100.0 * DEG) == pytest.approx(second.max_rate)
    for text, said in (
        ("t_s,rate\n0,0\n", "rate_dps"),
        ("t_s,rate_dps\n0,0\n1,5\n", "ends at 5"),
        ("t_s,rate_dps\n0,0\n0,0\n", "want it later"),
        ("t_s,rate_dps\n0,0\n1,x\n", "two numbers"),
        ("t_s,rate_dps\n0,0\n1,1e9\n2,0\n", "at most"),
    ):
        csv.write_text(text)
        with pytest.raises(ValueError, match=said):
            profile_of(str(csv))


def batch(values, sigma=1.0) -> list[Unit]:
    empty = {key: Cell(None, None) for key, *_ in COLUMNS}
    return [
        Unit(f"SN-{k}", f"s{k}", "x", "pass", empty | {"rate_bias_dps": Cell(v, sigma)})
        for k, v in enumerate(values)
    ]


def test_a_unit_unlike_the_others_is_named_where_its_own_sigma_allows():
    units = marked(batch([1.0, 1.1, 0.9, 1.05, 9.0]))
    assert [u.cells["rate_bias_dps"].outlier for u in units] == [False] * 4 + [True]
    assert "SN-4 is unlike the others in rate bias" in remarks(units)
    unsure = marked(batch([1.0, 1.1, 0.9, 1.05, 9.0], sigma=5.0))
    assert not any(u.cells["rate_bias_dps"].outlier for u in unsure)
    few = marked(batch([1.0, 9.0, 1.1]))
    assert not any(u.cells["rate_bias_dps"].outlier for u in few)
    assert "it takes 4" in remarks(few)[-1]


def test_a_file_of_the_folder_hides_a_shipped_one(tmp_path):
    (tmp_path / "staircase.toml").write_text(STILL)
    assert len(find("staircase", tmp_path).steps) == 1
    with pytest.raises(ProcedureError, match="did you mean 'six-poses'"):
        library.find("six-pose", tmp_path)
