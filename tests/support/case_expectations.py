"""What must hold of each case, by its name: a right result, or one sentence that says what is
wrong, where, and what to do.
"""

import math
import re
from collections.abc import Callable

import numpy as np

from support.cases import Command, Outcome

EKF, NAV = "products-ekf", "huber-nhc"
VALID = 85.0  # % of the log
RIGHT = 0.03  # rad/s RMS of a cube log's rate against its truth; the faults were 0.12 to 17


def says(command: Command, *words: str, code: int = 2) -> None:
    """A refusal in one sentence with these words."""
    assert command.code == code, (command.arguments, command.code, command.said)
    for word in words:
        assert word in command.said, (word, command.said)
    assert len(command.err.strip().splitlines()) <= 3, command.err


def works(command: Command) -> None:
    assert command.code == 0, (command.arguments, command.said)


def rates_right(command: Command, limit: float = RIGHT) -> None:
    """A cube's run whose rate is the truth's within a limit."""
    works(command)
    errors, valid = command.rates(EKF)
    assert len(errors) == 3 and max(errors) < limit, command.out
    assert valid > VALID, command.out  # a rate is not right by being withheld


def exported_rates_right(case: Outcome, pattern: str, log: str, limit: float = RIGHT) -> None:
    """Rates of an export against the truth of the log that it is of."""
    rows = case.table(pattern)
    assert rows, f"{pattern}: nothing exported"
    names = ("true_wx", "true_wy", "true_wz")
    table = np.genfromtxt(case.folder / log, delimiter=",", names=True)
    t = np.array([float(row["device_us"]) / 1e6 for row in rows])
    got = np.array([[float(row[f"omega_ib_b_radps_{x}"] or "nan") for x in "xyz"] for row in rows])
    # a played log has no date: the offset is where the rates fit best
    true = np.column_stack([table[name] for name in names])
    offsets = np.arange(-1.5, 1.5, 0.01) if "play" in pattern else np.zeros(1)
    errors = []
    for offset in offsets:
        at = t - t[0] + offset
        want = np.column_stack([np.interp(at, table["t_s"] - table["t_s"][0], c) for c in true.T])
        errors.append(np.sqrt(np.nanmean((got - want) ** 2, axis=0)).max())
    assert min(errors) < limit, f"{pattern}: {min(errors):.3f} rad/s off"


def hole_in_drive(case: Outcome) -> None:
    alone, beside = case.of("run")
    for one in (alone, beside):
        works(one)
        assert "40 samples are missing" in one.said
    assert alone.row(NAV)[:-1] == beside.row(NAV)[:-1] != [], "depends on who ran before"
    rows = case.table(f"exp/*.nav.{NAV}.csv")
    assert len(rows) > 1000
    tilts = [_tilt(row) for row in rows if row["alignment"] == "" or float(row["sigma_6"]) < 0.05]
    assert tilts and max(tilts[len(tilts) // 2 :]) < 0.2, "a car does not stand on its side"


def _tilt(row: dict[str, str]) -> float:
    w, x, y, z = (float(row[f"q_nb_{name}"]) for name in "wxyz")
    return math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y))))


def whole_milliseconds(case: Outcome) -> None:
    rates_right(case.of("run")[0])
    assert "gaps: 0, missing samples: 0" in case.of("run")[0].out
    index = [int(row["first_index"]) for row in case.table("exp/*.accel.csv")]
    assert index == list(range(len(index))) and index


def jitter(case: Outcome) -> None:
    rates_right(case.of("run")[0])
    assert "gaps: 0, missing samples: 0" in case.of("run")[0].out
    works(case.of("import")[0])


def every_tenth_lost(case: Outcome) -> None:
    rates_right(case.of("run")[0])
    works(case.of("import")[0])
    exported_rates_right(case, f"play/exp/*.rate.{EKF}.csv", "drop10.csv", 0.05)


def other_resolution(case: Outcome) -> None:
    for one in (*case.of("run"), *case.of("import")):
        says(one, "tenbit.csv", "0.125 g", "--lsb-mg 31.2")


def degrees(case: Outcome) -> None:
    says(case.of("import")[0], "att_deg.csv", "deg/s", "_degps")


def milliseconds(case: Outcome) -> None:
    ns, ms = case.of("run")
    says(ns, "basens.csv", "t_ns", "100 Hz")
    says(ms, "basems.csv", "t_ms", "100 Hz")
    says(case.of("import")[0], "basens.csv", "t_ns")


def swapped(case: Outcome) -> None:
    run, made = *case.of("run"), *case.of("import")
    rates_right(run, 0.3)
    for one in (run, made):
        works(one)
        assert "a21" in one.said and "a22" in one.said, one.said
    assert "10 of 12 good" in run.out and "swapped" in run.out


def result_or_reason(case: Outcome) -> None:
    for one in case.of("run"):
        if any(re.fullmatch(r"[\d.e+-]*\d[\d.e+-]*", cell) for cell in one.row(NAV)[:-1]):
            works(one)
        else:
            says(one, "note:", code=1)
            assert re.search(r"velocity|alignment|heading", one.said), one.said


def drive_works(case: Outcome) -> None:
    for one in (*case.of("run"), *case.of("import")):
        works(one)
    assert any(cell not in ("", "-") for cell in case.of("run")[0].row(NAV)[:-1])


def empty_quality(case: Outcome) -> None:
    says(case.of("run")[0], "gnss.csv:2", "quality", "empty", "want 1 fixed", code=1)


def negative_time(case: Outcome) -> None:
    rates_right(case.of("run")[0])
    works(case.of("import")[0])


def mark(case: Outcome) -> None:
    first, attitude = case.of("run")
    rates_right(first)
    works(case.of("import")[0])
    works(attitude)
    assert any(cell != "-" for cell in attitude.row("vqf"))


def encodings(case: Outcome) -> None:
    assert len(case.of("doctor")) == 2
    for one in case.of("doctor"):
        assert one.code in (0, 1) and "dashboard port" in one.out, one.said


def plain(case: Outcome) -> None:
    for one in case.of("run"):
        rates_right(one)
    for one in case.of("import"):
        works(one)


def device_name(case: Outcome) -> None:
    says(case.of("import")[0], "'Cube 1'", "want a-z")


def unchunked(case: Outcome) -> None:
    works(case.of("export")[0])
    assert "no message" not in case.output
    for pattern, n in (("exp/log.accel.csv", 2000), (f"exp/log.rate.{EKF}.csv", 2000)):
        assert len(case.table(pattern)) > n, pattern


def foreign_topic(case: Outcome) -> None:
    works(case.of("export")[0])
    assert "/camera/info" in case.of("export")[0].said
    assert (case.folder / "exp" / "cut.mcap").stat().st_size > 100_000


def no_position(case: Outcome) -> None:
    fixes = case.table("exp/*.gnss.csv")
    assert not [f for f in fixes if float(f["quality"] or 0) and abs(float(f["latitude_deg"])) < 1]


def no_height(case: Outcome) -> None:
    fixes = case.table("exp/*.gnss.csv")
    assert fixes, "latitude and longitude are good"
    for fix in fixes:
        height = float(fix["height_m"] or "nan")
        sigma = float(fix.get("position_sigma_ned_m_d") or "nan")
        assert math.isnan(height) or sigma >= 100.0, f"height {height} m, sigma {sigma} m"


def corrected_clock(case: Outcome) -> None:
    """The receiver's UTC is 2 s ahead for 10 s; device time must not follow it for longer."""
    rows = case.table("exp/*.gnss.csv")
    known = [row for row in rows if float(row["device_time_s"]) > 0.0]
    off = [abs(float(r["device_time_s"]) - float(r["device_us"]) / 1e6) for r in known]
    late = off[len(off) * 15 // 26 :]  # five seconds after the correction
    assert len(known) > 60 and max(late) < 0.3, f"off by {max(late):.2f} s"


def heard_or_fixed(case: Outcome) -> None:
    fixes = case.table("exp/nochk.gnss.csv")
    said = [row["message"] for row in case.table("exp/nochk.link.csv") if row["message"]]
    assert fixes or said, "sentences without a checksum: nothing read and nothing said"
    assert case.table("exp/cronly.gnss.csv") or [
        row for row in case.table("exp/cronly.link.csv") if row["message"]
    ]


def sea_level(case: Outcome) -> None:
    heights = re.findall(r"<ele>([0-9.-]+)", (case.folder / "exp" / "track.gpx").read_text())
    assert heights and max(abs(float(h) - 310.5) for h in heights) < 0.1, heights[:3]


def nan_cell(case: Outcome) -> None:
    says(case.of("run")[0], "nan.csv:702", "'a11_counts'", "'nan'")


def repeated_stamps(case: Outcome) -> None:
    says(case.of("run")[0], "p6400_3.csv:3", "'t_s'", "does not rise")


def page_names(case: Outcome) -> None:
    """Said by run.sh only; the page's own tests upload files of such names."""
    assert "page" in case.output


EXPECTED: dict[str, Callable[[Outcome], None]] = {
    "a1-imu-hole-0p4s": hole_in_drive,
    "b1-ms-stamps-800hz": whole_milliseconds,
    "b3-jitter-4ms": jitter,
    "b4-every-10th-lost": every_tenth_lost,
    "c1-scale-10bit": other_resolution,
    "c3-deg-in-radps": degrees,
    "c4-ms-or-ns-in-t_s": milliseconds,
    "d1-axes-swapped": swapped,
    "e1-position-only-gnss": result_or_reason,
    "e3-quality-3": drive_works,
    "e4-quality-empty": empty_quality,
    "f1-negative-time": negative_time,
    "g1-bom": mark,
    "g2-config-ansi": encodings,
    "g5-comment-in-drive": drive_works,
    "g6-quoted-header": plain,
    "h1-page-file-names": page_names,
    "h3-device-name": device_name,
    "i1-mcap-unchunked": unchunked,
    "i2-mcap-foreign-topic": foreign_topic,
    "j1-invalid-llh": no_position,
    "j2-rmc-only-height": no_height,
    "j5-leap-second": corrected_clock,
    "j6-silent-no-checksum": heard_or_fixed,
    "k1-gpx-kml-height": sea_level,
    "p1-crlf": plain,
    "p2-nan-cell": nan_cell,
    "p3-dup-stamps": repeated_stamps,
}


def hold(name: str, case: Outcome) -> None:
    """Hold a case against its expectation; one without is held to the least: an answer."""
    for text in (case.output, *(one.said for one in case.commands)):
        assert "Traceback" not in text, text
    for one in case.commands:
        assert one.code in (0, 1, 2, 3), one
        assert one.code == 0 or one.err.strip(), f"no reason given: {one.arguments}"
    if name in EXPECTED:
        EXPECTED[name](case)
