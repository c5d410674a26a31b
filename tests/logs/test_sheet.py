"""One reader of CSV: the same numbers however they are written, and errors that name the place."""

import gzip
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from logs.sheet import LogError, open_sheet

NAMES = ("t_s", "fx_mps2", "Temp °C")
numbers = st.floats(-1e6, 1e6, allow_nan=False).map(lambda v: round(v, 6))


def read(path, names=("t_s", "a"), may_miss=()):
    return open_sheet(path).read(list(names), may_miss)


@st.composite
def written(draw):
    """A table and the bytes of one way to write it."""
    table = draw(st.lists(st.tuples(numbers, numbers, numbers), min_size=1, max_size=8))
    separator = draw(st.sampled_from([",", ";", "\t", "|"]))
    comma = separator != "," and draw(st.booleans())
    quoted, newline = draw(st.booleans()), draw(st.sampled_from(["\n", "\r\n", "\r"]))
    encoding = draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"]))
    comment = draw(st.sampled_from(["", "# von Hand, gemessen", "% a; b", "// x|y\tz"]))

    def cell(value):
        text = f"{value:.6f}" if isinstance(value, float) else value
        text = text.replace(".", ",") if comma and isinstance(value, float) else text
        return f'"{text}"' if quoted else text

    lines = [comment] if comment else []
    lines.append(separator.join(cell(name) for name in NAMES))
    for row in table:
        lines.append(separator.join(cell(value) for value in row))
        if draw(st.booleans()):
            lines.append(draw(st.sampled_from(["", comment or "#", separator * 2])))
    return np.array(table), (newline.join(lines) + newline).encode(encoding)


@settings(max_examples=300, deadline=None)
@given(written())
def test_the_same_numbers_however_they_are_written(tmp_path_factory, pair):
    table, data = pair
    path = tmp_path_factory.mktemp("sheet") / "Messung Prüfstand (1).csv"
    path.write_bytes(data)
    got = read(path, NAMES)
    np.testing.assert_array_equal(np.column_stack([got[name] for name in NAMES]), table)
    lines = data.decode(open_sheet(path).encoding).splitlines()
    for row, line in zip(table, got.lines, strict=True):
        assert f"{abs(row[0]):.6f}"[:3].replace(".", "") in lines[line - 1].replace(
            ",", ""
        ).replace(".", "")


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", ["empty", "header"]),
        (b"# only this\n", ["empty"]),
        (b"0,1\n1,2\n", [":1:", "numbers where the columns' names"]),
        (b"t_s a\n0 1\n", [":1:", "'t_s'", "one column only", "semicolon"]),
        (b"t_s,a,a\n0,1,2\n", [":1:", "'a' stands there twice"]),
        (b"t_s,b\n0,1\n", [":1:", "'a' is missing", "found t_s, b"]),
        (b"# c\nt_s,a\n0,1\n\n#x\n1,zwei\n", [":6:", "'a'", "'zwei'"]),
        (b"t_s,a\n0,1\n\n1,nan\n", [":4:", "'a'", "'nan'"]),
        (b"t_s,a\n0,1\n1,inf\n", [":3:", "'a'", "'inf'"]),
        (b"t_s,a,b\n0,1,2\n1,2\n2,3,4\n", [":3:", "2 cells", "names 3"]),
        (b't_s,a\n0,"1,5"\n', [":2:", "decimal comma", "semicolon"]),
        (bytes(range(256)) * 8, ["not a text file"]),
        (b"x" * 100_000, [":1:", "64 kB"]),
        (b"t_s,a\n0," + b"1" * 3_000_000 + b"\n", ["1 MB"]),
    ],
)
def test_what_cannot_be_used_is_named_with_its_place(tmp_path, data, words):
    path = tmp_path / "log.csv"
    path.write_bytes(data)
    with pytest.raises(LogError) as caught:
        read(path)
    for word in (str(path), *words):
        assert word in str(caught.value), caught.value


def test_a_last_line_cut_off_is_left_out_and_said(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(b"t_s,a,b\n0,1,2\n1,2")
    got = read(path)
    assert got.cut_off and got["t_s"].tolist() == [0.0]
    path.write_bytes(b"t_s,a,b\n0,1,2\n1,2,3")
    assert not read(path).cut_off and len(read(path)) == 2


def test_cells_that_may_miss_become_nan(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(b"t_s,a\n0,\n1,2\n2,NA\n")
    assert np.isnan(read(path, may_miss=("a",))["a"]).tolist() == [True, False, True]


def test_what_is_no_file_of_text_is_named(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "zip").write_bytes(b"PK\x03\x04" + bytes(30))
    (tmp_path / "gz").write_bytes(gzip.compress(b"t_s,a\n0,1\n"))
    (tmp_path / "mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(30))
    for name, words in (
        ("pipe", "a pipe"),
        ("", "a folder"),
        ("zip", "save its sheet as CSV"),
        ("gz", "gunzip"),
        ("mcap", "export, report or rerun"),
    ):
        with pytest.raises(LogError, match=words):
            open_sheet(tmp_path / name)
    with pytest.raises(LogError, match="a device"):
        open_sheet(Path("/dev/zero"))


def test_a_line_that_is_too_long_is_named_by_its_number(tmp_path):
    path = tmp_path / "log.csv"
    with path.open("wb") as file:
        file.write(b"t_s,a\n" + b"0,1\n" * 70_000)
        file.truncate(file.tell() + 20 * 1024**2)  # a hole of zeros: one line
    with pytest.raises(LogError, match="log.csv:70002: a line of more than 1 MB"):
        read(path)


def test_a_file_that_grows_is_read_as_it_was_found(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(b"t_s,a\n0,1\n1,2\n")
    sheet = open_sheet(path)
    with path.open("ab") as file:
        file.write(b"2,3\n3,")
    table = sheet.read(["t_s", "a"])
    assert table["t_s"].tolist() == [0.0, 1.0] and not table.cut_off


def test_comments_and_empty_lines_by_the_thousand_cost_little_and_lines_stay_right(tmp_path):
    path, n = tmp_path / "log.csv", 60_000
    body = "".join(f"# {k}\n{k},{k}\n,\n\n" for k in range(n))
    path.write_text("t_s,a\n" + body + "x,1\n")
    with pytest.raises(LogError, match=f":{4 * n + 2}: column 't_s': 'x'"):
        read(path)
    path.write_text("t_s,a\n" + body)
    got = read(path)
    np.testing.assert_array_equal(got.lines, 3 + 4 * np.arange(n))


def test_words_of_a_file_reach_no_terminal_as_orders(tmp_path):
    path = tmp_path / "log.csv"
    for data in (
        b"\x1b[31mt_s,b\x07\n0,1\n",
        b"t_s,a\n0,\x1b]0;x\x07\n",
        b"t_s,a,b\n0,\x1b[1m\n1,2,3\n",
    ):
        path.write_bytes(data)
        with pytest.raises(LogError) as caught:
            read(path)
        assert str(caught.value).removeprefix(str(path)).isprintable()


@pytest.mark.parametrize(
    "name",
    ["Prüfstand.csv", "Pru\u0308fstand.csv", "a (1) [2].csv", "#50%.csv", "-x.csv", "a\nb.csv"],
)
def test_a_file_may_have_any_name(tmp_path, name):
    (tmp_path / name).write_bytes(b"t_s,a\n0,1\n1,2\n")
    assert read(tmp_path / name)["a"].tolist() == [1.0, 2.0]


def test_bytes_that_windows_1252_does_not_know_end_nothing(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(b"t_s,a\n# \x81\x8d\xff\n" + b"0,1\n" * 40_000 + b"1,2\n")
    assert len(read(path)) == 40_001


def test_a_refused_log_ends_the_process_in_peace(tmp_path):
    """What still reads when the interpreter ends stops the process in the middle of nothing."""
    log = tmp_path / "twice.csv"
    row = ",".join(["0"] * 12)
    head = ",".join(f"a{s}{a}_counts" for s in range(1, 5) for a in range(1, 4))
    log.write_text(f"t_s,{head}\n" + "".join(f"{k // 2},{row}\n" for k in range(20_000)))
    code = (
        "import sys\n"
        "from logs.cube_log import read_log\n"
        "names = [f'a{s}{a}' for s in range(1, 5) for a in range(1, 4)]\n"
        "try: read_log(sys.argv[1], names)\n"
        "except ValueError as error: print(error)\n"
    )
    for _ in range(5):  # it went wrong in two of nine
        done = subprocess.run([sys.executable, "-c", code, log], capture_output=True, text=True)
        assert done.returncode == 0 and "does not rise" in done.stdout, done.stderr


# --- how other programs head their tables


@st.composite
def headed(draw):
    """One table of inertial samples, and the bytes of one way to head it."""
    rows = draw(st.lists(st.tuples(numbers, numbers, numbers), min_size=1, max_size=4))
    separator = draw(st.sampled_from([",", ";", "\t", "|"]))
    heads = draw(
        st.sampled_from(
            [
                (("t_s", "fx_mps2", "wz_radps"), None),
                (("T_S", "FX_MPS2", "WZ_RADPS"), None),
                (("t s", "fx mps2", "wz radps"), None),
                (("Time (s)", "fx [m/s^2]", "wz (rad/s)"), None),
                (("time [sec]", "FX (m/s\u00b2)", "Wz [rad/s]"), None),
                (("Timestamp", "fx", "wz"), ("s", "m/s2", "rad/s")),
                (("t", "Fx", "WZ"), ("[s]", "[m/s^2]", "(rad/s)")),
                (("t_s", "fx_mps2", "wz_radps"), ("s", "m/s/s", "rad/s")),
            ]
        )
    )
    ends = draw(
        st.sampled_from([("", ""), (separator, separator), ("", separator), (separator, "")])
    )
    newline = draw(st.sampled_from(["\n", "\r\n", "\r"]))
    lines = [f"sep={separator}"] if draw(st.booleans()) else []
    for k, row in enumerate([part for part in heads if part] + rows):
        texts = [cell if isinstance(cell, str) else f"{cell:.6f}" for cell in row]
        lines.append(separator.join(texts) + ends[bool(k)])
    lines += [""] * draw(st.integers(0, 3))
    return np.array(rows), (newline.join(lines) + newline).encode()


@settings(max_examples=200)
@given(headed())
def test_the_same_columns_however_they_are_headed(tmp_path_factory, pair):
    rows, data = pair
    path = tmp_path_factory.mktemp("sheet") / "log.csv"
    path.write_bytes(data)
    names = ("t_s", "fx_mps2", "wz_radps")
    got = read(path, names)
    np.testing.assert_array_equal(np.column_stack([got[name] for name in names]), rows)


@pytest.mark.parametrize(
    ("first", "second", "apart"),
    [
        ("2024-06-14T12:00:00.000Z", "2024-06-14T12:00:00.010Z", 0.010),
        ("2024-06-14T14:00:00+02:00", "2024-06-14T14:00:01+02:00", 1.0),
        ("2024-06-14 12:00:00.25", "2024-06-14 12:00:00.5", 0.25),
        ("2024-06-14T12:00:00", "2024-06-15T12:00:00", 86400.0),
    ],
)
@pytest.mark.parametrize("name", ["t_s", "time", "Timestamp", "t"])
def test_a_date_is_a_time(tmp_path, first, second, apart, name):
    path = tmp_path / "log.csv"
    path.write_text(f"{name},a\n{first},1\n{second},2\n")
    t = read(path)["t_s"]
    assert t[0] // 1 == 1718366400 and t[1] - t[0] == pytest.approx(apart, abs=1e-6)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("t_s,a\n2024-06-14T12:00:00Z,1\n12.5,2\n", ":3: column 't_s': '12.5'"),
        ("t_s,a\nms,-\n1,2\n", ":2: column 't_s' is in 'ms'"),
        ('t_s,a\n0,1\n1,"1,234"\n', "thousands"),
        ("t_s;a\n0;1\n1;1.234,5\n", "thousands"),
        ("t_s,a,a\n0,1,2\n", "column 'a' stands there twice"),
        ("t_s;a\n0.00;1,5\n", ":2: column 't_s': '0.00' is no finite number (other numbers"),
        ("time (ms),a\n0,1\n", "column 't_s' is missing, found time (ms), a"),
        ("time (furlongs),a\n0,1\n", "column 't_s' is missing"),
    ],
)
def test_what_two_readings_has_is_not_guessed(tmp_path, text, said):
    path = tmp_path / "log.csv"
    path.write_text(text)
    with pytest.raises(LogError) as caught:
        read(path)
    assert said in str(caught.value)


def test_columns_that_nobody_asks_for_may_stand_twice(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t_s,a,note,note\n0,1,x,y\n1,2,x,y\n")
    assert len(read(path)) == 2


@pytest.mark.parametrize("last", ["2,3.25e-", "2,3.2.", "2", "2024-", "-"])
def test_a_log_that_ends_within_a_row_keeps_the_rows_before_it(tmp_path, last):
    path = tmp_path / "log.csv"
    path.write_text(f"t_s,a\n0,1\n1,2\n{last}")
    table = read(path)
    assert len(table) == 2 and table.cut_off
