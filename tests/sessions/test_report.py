"""The report: true to the simulator that made the run, the same bytes again, honest verdicts."""

import dataclasses
import html
import io
import json
import re

import numpy as np
import pytest
from pypdf import PdfReader
from support.hostile import HOSTILE
from support.table_session import SESSION, table_recording, table_root

from messages.text import printed
from sessions.recording.manifest import read_manifest
from sessions.report.analysis import analyse
from sessions.report.build import build
from sessions.report.data import ReportError, Tacho, load_run
from sessions.report.document import Document
from sessions.report.html import to_html
from sessions.report.metrics import metrics
from sessions.report.pdf import to_pdf
from sessions.report.segments import reference, segment
from sessions.report.stability import allan_of, consistency
from sessions.report.table_test import Plateau, scale_factor
from sessions.report.verdict import Limit, Spec, SpecError, judge, load_spec, overall


@pytest.fixture(scope="module")
def analysis():
    return analyse(load_run(table_recording()), read_manifest(table_root() / SESSION))


@pytest.fixture(scope="module")
def report():
    return build(table_recording(), load_spec(None))


def test_the_run_is_cut_into_the_profile_that_was_played(analysis):
    """Still 5 s, -171 deg/s for 8 s, still 3 s, +171 deg/s for 8 s, still 2 s, with a second of
    ramp between.
    """
    levels = np.degrees([part.omega for part in analysis.segments])
    assert levels == pytest.approx([0, -171, 0, 171, 0], abs=0.5)
    begins = [part.begin for part in analysis.segments]
    assert begins == pytest.approx([0.0, 6.0, 15.0, 19.0, 28.0], abs=0.8)  # settling is cut off


def test_bias_and_tilt_are_the_simulators(analysis):
    """Equivalent bias of twelve axes: what (25) makes of the simulated ones; the table is tilted by
    2 degrees.
    """
    assert np.degrees(analysis.cube.tilt) == pytest.approx(2.0, abs=0.15)
    assert (
        np.abs(analysis.cube.bias_b).max() < 0.5
    )  # m/s^2: 20 mg and half a percent of g, per axis
    assert np.abs(analysis.cube.bias_b).max() > 1e-4


def test_figures_agree_with_the_estimators_own_errors(analysis):
    products, least = analysis.rate("products-ekf"), analysis.rate("least-squares")
    assert np.degrees(products.rms[2]) < 2.0 < np.degrees(least.rms).max()
    assert abs(products.fit.scale_factor - 1.0) < 0.02
    assert 0.7 < products.nis.mean < 1.4


def test_same_recording_same_bytes(report):
    again = build(table_recording(), load_spec(None))
    assert again.html == report.html
    assert again.json == report.json
    assert again.pdf == report.pdf


def test_the_three_forms_say_the_same(report):
    data = json.loads(report.json)
    text = "".join(page.extract_text() for page in PdfReader(io.BytesIO(report.pdf)).pages)
    assert data["session"] == SESSION and SESSION in report.html and SESSION in text
    assert data["verdict"] == report.verdict
    assert report.html.count("<img") >= 9
    for section in ("Rate error on every plateau", "Stability at rest", "Provenance", "Tested by"):
        assert section in report.html and section in text
    assert data["sha256"] in report.html


def test_a_broken_limit_fails_and_an_unknown_one_is_refused(analysis):
    found = metrics(analysis, "products-ekf")
    strict = Spec(limits={"rate_rms_z_dps": Limit(max=0.001), "completeness": Limit(min=0.9)})
    assert overall(judge(strict, found)) == "fail"
    assert [check.passed for check in judge(strict, found)] == [False, True]
    with pytest.raises(SpecError, match="did you mean"):
        judge(Spec(limits={"completenes": Limit(min=0.9)}), found)


def test_what_cannot_be_told_is_no_pass(analysis):
    other = metrics(analysis, "no-such-estimator")
    assert overall(judge(Spec(limits={"rate_rms_z_dps": Limit(max=9.0)}), other)) == "incomplete"


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("title = 3", "title"),
        ("[limits.a]\n", "limits.a"),
        ("[limits", "not TOML"),
        ("[limits.a]\nmaxx=1", "maxx"),
    ],
)
def test_a_wrong_specification_names_file_and_place(tmp_path, text, what):
    path = tmp_path / "spec.toml"
    path.write_text(text)
    with pytest.raises(SpecError, match=what) as refused:
        load_spec(path)
    assert str(path) in str(refused.value)


def test_a_device_that_is_not_there_is_said():
    with pytest.raises(ReportError, match="there is cube"):
        load_run(table_recording(), device="car")
    with pytest.raises(ReportError, match="no boot 77"):
        load_run(table_recording(), boot=77)


def test_reference_is_the_table_also_where_pulses_begin_and_end():
    """Pulses of a table that speeds up evenly from rest: 1 degree apart, rate as the mean since the
    pulse before.
    """
    rate, pitch = np.radians(60.0), np.radians(1.0)  # rad/s^2, rad
    at = np.sqrt(2.0 * pitch * np.arange(1, 400) / rate)
    omega = np.concatenate([[0.0], pitch / np.diff(at)])
    tacho = Tacho(at, omega, np.full(len(at), 0.01))
    t = np.linspace(0.0, at[-1], 500)
    error = reference(tacho, t) - rate * t
    assert np.degrees(np.abs(error[(t > at[2]) & (t < 0.995 * at[-1])]).max()) < 0.6
    assert reference(tacho, np.array([-1.0, at[-1] + 2.0])) == pytest.approx([0.0, 0.0])


def test_a_table_that_only_ramps_has_no_plateau():
    t = np.arange(0.1, 10.0, 0.02)
    ramp = Tacho(t, np.radians(30.0) * t, np.full(len(t), 0.01))
    assert [part for part in segment(ramp, 10.0) if not part.still] == []


def plateau(segment_, indicated, standard_error=0.001):
    mean = np.array([0.0, 0.0, indicated])
    return Plateau(
        segment=dataclasses.replace(segment_),
        samples=500,
        mean=mean,
        scatter=np.zeros(3),
        error=mean - [0, 0, segment_.omega],
        standard_error=np.full(3, standard_error),
        rms=np.zeros(3),
    )


def test_scale_factor_bias_and_asymmetry_are_recovered(analysis):
    """Indicated = 0.01 + 1.002 w to the right, 0.998 w to the left: asymmetry 4000 ppm."""
    base = analysis.segments[0]
    found = []
    for level in (-3.0, -1.5, 0.0, 1.5, 3.0):
        part = dataclasses.replace(base, omega=level)
        found.append(plateau(part, 0.01 + level * (1.002 if level > 0 else 0.998)))
    fit = scale_factor(found)
    assert fit.scale_factor == pytest.approx(1.0, abs=1e-3)
    assert fit.asymmetry_ppm == pytest.approx(4000.0, rel=1e-3)
    assert fit.linearity_ppm == pytest.approx(1200.0, rel=0.6)


def test_allan_deviation_of_white_noise_has_slope_minus_half():
    noise = np.random.default_rng(5).normal(0.0, 0.04, 20_000)
    found = allan_of("a11", noise, 0.01)
    assert found.slope == pytest.approx(-0.5, abs=0.05)
    assert found.random_walk == pytest.approx(0.04 * np.sqrt(0.01), rel=0.15)
    assert (found.low < found.deviation).all() and (found.deviation < found.high).all()
    assert allan_of("stuck", np.ones(1000), 0.01) is None


def test_consistency_of_a_chi_square_is_one():
    dof = np.full(4000, 6)
    found = consistency("x", np.random.default_rng(2).chisquare(6, 4000), dof)
    assert found.low < found.mean < found.high
    assert found.beyond == pytest.approx(0.05, abs=0.015)
    assert consistency("x", dof * 2.0, dof).mean == pytest.approx(2.0)


@pytest.mark.parametrize("word", HOSTILE, ids=range(len(HOSTILE)))
def test_a_report_shows_texts_as_text(word):
    """Of a manifest that somebody brought along."""
    said = Document(
        title=word,
        verdict="pass",
        facts=[("Note", word), (word, word)],
        checks=[(word, word, word, "pass")],
        grids=[],
        pictures=[],
        provenance=[(word, word)],
    )
    page = to_html(said)
    body = page.split("</style>")[-1]
    shown = html.unescape(re.sub(r"<[^>]*>", "", body))
    assert printed(word)[:200] in shown
    assert not {"\u202e", "\x1b", "\u200b"} & set(page)
    assert not re.search(r"<(script|img|svg|iframe|a)\b", body)
    assert to_pdf(said).startswith(b"%PDF")
