"""Layouts as files, what they can see, and the search for better ones."""

import json
import tomllib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import check_grad
from typer.testing import CliRunner

from estimator.choice import UnknownEstimator, make_layout
from estimator.settings import LayoutSettings
from gyrofree.commands.main import app
from inertial.layouts import catalogue, search
from inertial.layouts.catalogue import CUBE, LAYOUTS
from inertial.layouts.layout import GeometryError, Layout
from inertial.layouts.quality import PRODUCT, UNKNOWNS, analyse, rate_information

AXIS = {"position_m": [0.05, 0, 0], "direction": [0, 1, 0]}
quick = search.Wish(starts=4)


# --- files


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_layout_survives_being_written_and_read(name):
    layout = catalogue.find(name, 0.05)
    again = catalogue.parse(tomllib.loads(catalogue.as_toml(layout)), "again.toml")
    np.testing.assert_allclose(again.r_b, layout.r_b, atol=1e-9)
    np.testing.assert_allclose(again.theta_b, layout.theta_b, atol=1e-11)
    assert (again.axis_names, again.channels, again.sensors) == (
        layout.axis_names,
        layout.channels,
        layout.sensors,
    )
    assert again.gdop == pytest.approx(layout.gdop, rel=1e-6) and again.rank == layout.rank


def test_a_half_side_sizes_built_in_layouts_but_not_a_board_as_it_was_made():
    np.testing.assert_allclose(catalogue.find("cube", 0.1).r_b, 2 * CUBE(0.05).r_b)
    assert catalogue.find("array-24", 0.1).scale_m == catalogue.find("array-24").scale_m == 0.00945


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, r"my.toml: want 1 to 64 tables \[\[axes\]\]"),
        ({"axes": [AXIS], "axis": 1}, "unknown key 'axis': did you mean axes"),
        (
            {"axes": [AXIS, {"name": "top", "direction": [0, 1, 0]}]},
            r"axis 2 \(top\): position_m = None, want three",
        ),
        ({"axes": [AXIS | {"direction": [0, 0, 0]}]}, r"axis 1 \(a1\): direction .* has no length"),
        ({"axes": [AXIS | {"position_m": [0, float("nan"), 0]}]}, r"axis 1 \(a1\): position_m"),
        ({"axes": [AXIS, AXIS | {"channel": 0}]}, "channel 0 is axis 1's already"),
        ({"axes": [AXIS | {"name": "x"}, AXIS | {"name": "x"}]}, "name x is axis 1's already"),
        ({"axes": [AXIS | {"sensor": "adxl"}]}, "sensor 'adxl', want one of adxl345, mpu9150"),
        ({"axes": [AXIS | {"scale": 0}]}, "scale = 0, want a number above 0"),
        (
            {"axes": [AXIS], "sensors": {"mine": {"noise": 1}}},
            r"\[sensors.mine\]: unknown key 'noise': did you mean",
        ),
    ],
)
def test_a_file_that_cannot_be_is_refused_by_axis(values, message):
    with pytest.raises(GeometryError, match=message):
        catalogue.parse(values, "my.toml")


def test_names_and_files_that_do_not_exist(tmp_path):
    with pytest.raises(GeometryError, match=r"no layout 'cub' \(did you mean cube\?\)"):
        catalogue.find("cub")
    with pytest.raises(GeometryError, match="No such file"):
        catalogue.find(str(tmp_path / "none.toml"))
    (tmp_path / "bad.toml").write_text("axes = [")
    with pytest.raises(GeometryError, match="not TOML"):
        catalogue.find(str(tmp_path / "bad.toml"))


def test_channels_and_scales_map_a_board_to_axes():
    layout = Layout("wired", np.eye(3), np.eye(3), channels=(2, 0, 1), gain=(2.0, 1.0, -0.5))
    np.testing.assert_allclose(layout.read(np.array([[1.0, 10.0, 100.0]])), [[200.0, 1.0, -5.0]])
    board = np.ones((4, 12))
    assert CUBE(0.05).read(board) is board  # nothing to do costs nothing


def test_the_configuration_takes_a_name_or_a_file(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(catalogue.as_toml(catalogue.find("nine", 0.03)))
    assert make_layout(LayoutSettings(kind="edges-12", half_side_m=0.1)).scale_m == 0.1
    assert make_layout(LayoutSettings(file=str(file))).scale_m == pytest.approx(0.03)
    with pytest.raises(ValueError, match="no layout 'cubes', want one of"):
        LayoutSettings(kind="cubes")
    with pytest.raises(UnknownEstimator, match=r"\[estimator\] layout: .*none.toml"):
        make_layout(LayoutSettings(file=str(tmp_path / "none.toml")))


# --- quality


@pytest.mark.parametrize(
    ("name", "kappa", "gdop", "in_alpha", "in_force", "products"),
    [
        ("cube", "1.414", "1.0607", False, False, 6),
        ("chen-6", "1.000", "1.732", False, True, 0),
        ("nine", "1.2247", "1.5811", True, False, 0),
        ("edges-12", "2.000", "1.2748", True, True, 6),
        ("stars-12", "1.732", "1.000", False, True, 2),
    ],
)
def test_the_published_table_of_layouts(name, kappa, gdop, in_alpha, in_force, products):
    q = analyse(LAYOUTS[name](0.05))
    assert f"{q.kappa:.{len(kappa) - 2}f}" == kappa and f"{q.gdop:.{len(gdop) - 2}f}" == gdop
    assert (q.feedback_alpha, q.feedback_force) == (in_alpha, in_force)
    assert int((q.singular_products > 1e-6).sum()) == products


def test_observability_says_which_products_are_left():
    assert analyse(CUBE(0.05)).seen == ("yes",) * 12
    stars = analyse(LAYOUTS["stars-12"](0.05))
    assert stars.rank == 8 and stars.mixtures == ("wxwx - wzwz", "wywy - wzwz")
    assert all(stars.seen[UNKNOWNS.index(name)] == "no" for name in PRODUCT)
    array = dict(zip(UNKNOWNS, analyse(catalogue.find("array-24")).seen, strict=True))
    assert array["w'z"] == array["wxwy"] == array["px"] == "yes"
    assert (
        array["w'x"] == array["w'y"] == array["wxwx"] == array["wzwz"] == "weak"
    )  # the board is flat


def test_predicted_noise_is_what_samples_show():
    layout, draw = LAYOUTS["edges-12"](0.05), np.random.default_rng(3)
    q = analyse(layout)
    a = draw.normal(size=(20000, 12)) * layout.noise
    np.testing.assert_allclose((a @ layout.S.T).std(axis=0), q.sigma_least_squares, rtol=0.03)
    np.testing.assert_allclose((a @ layout.field_inverse.T).std(axis=0), q.sigma_field, rtol=0.03)


@settings(deadline=None, max_examples=20)
@given(omega=st.tuples(*[st.floats(-10.0, 10.0)] * 3).map(np.array))
def test_information_on_the_rate_is_that_of_its_products(omega):
    cube = CUBE(0.05)
    R = cube.noise[0] ** 2 * cube.field_inverse[6:] @ cube.field_inverse[6:].T
    x, y, z = omega
    H = np.array([[2 * x, 0, 0], [y, x, 0], [z, 0, x], [0, 2 * y, 0], [0, z, y], [0, 0, 2 * z]])
    np.testing.assert_allclose(
        rate_information(cube, omega), H.T @ np.linalg.inv(R) @ H, rtol=1e-5, atol=1e-3
    )


# --- search


@pytest.mark.parametrize(
    "wish",
    [
        search.Wish(),
        search.Wish(triads=True, rank=12),
        search.Wish(rank=12, region=search.Region(radius_m=0.05)),
        search.Wish(axes=9, region=search.Region(points_m=((0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1)))),
    ],
)
def test_gradient_of_the_search(wish):
    problem = search._Problem(wish)
    v = problem.start(np.random.default_rng(5))
    error = check_grad(lambda v: problem.value(v, 3.0)[0], lambda v: problem.value(v, 3.0)[1], v)
    assert error < 1e-5 * np.linalg.norm(problem.value(v, 3.0)[1])


def test_twelve_axes_reach_gdop_one_and_the_price_is_shown():
    told = []
    found = search.search(quick, lambda done, what: told.append(done))
    q = analyse(found.layout)
    assert q.gdop == pytest.approx(1.0, abs=1e-5) and found.bound == pytest.approx(1.0)
    assert (
        q.rank == 8 and q.feedback_force and len(q.mixtures) == 2
    )  # six products are not seen alone
    assert told[-1] == 1.0 and len(told) == 4


def test_all_products_without_feedback_and_still_better_than_the_cube():
    wish = search.Wish(rank=12, no_feedback=True, starts=2, seed=1)
    q = analyse(search.search(wish).layout)
    assert q.rank == 12 and not q.feedback_alpha and not q.feedback_force
    assert q.gdop < 1.0607 and q.condition < 50.0


def test_the_cube_is_the_best_of_its_kind():
    found = search.search(search.Wish(triads=True, rank=12, no_feedback=True, starts=2))
    assert (
        found.layout.gdop
        == pytest.approx(found.bound, abs=1e-6)
        == pytest.approx(CUBE(1.0).gdop, abs=1e-6)
    )


def test_the_same_seed_finds_the_same_layout():
    a, b = (search.search(search.Wish(axes=9, starts=2, seed=4)).layout for _ in range(2))
    np.testing.assert_array_equal(a.r_b, b.r_b)
    np.testing.assert_array_equal(a.theta_b, b.theta_b)


def test_axes_stay_where_they_may_be():
    points = ((0.05, 0.05, 0.0), (-0.05, 0.05, 0.0), (0.0, -0.05, 0.02), (0.0, 0.0, -0.05))
    given_points = search.search(
        search.Wish(region=search.Region(points_m=points), starts=2)
    ).layout
    assert {tuple(np.round(r, 9)) for r in given_points.r_b} == set(points)
    ball = search.search(search.Wish(region=search.Region(radius_m=0.04), starts=2)).layout
    assert np.linalg.norm(ball.r_b, axis=1).max() <= 0.04 * (1 + 1e-9)


def test_wishes_that_cannot_be_are_refused():
    with pytest.raises(GeometryError, match="rank 12 of 9 axes"):
        search.search(search.Wish(axes=9, rank=12))
    with pytest.raises(GeometryError, match="a multiple of 3 for triads"):
        search.search(search.Wish(axes=10, triads=True))
    flat = search.Region(half_sides_m=(0.05, 0.05, 0.0))
    with pytest.raises(GeometryError, match="no layout of 12 axes with rank 12 in this region"):
        search.search(search.Wish(rank=12, region=flat, starts=2))


# --- command line


def test_show_and_compare_print_tables_and_json(tmp_path):
    run = CliRunner()
    shown = run.invoke(app, ["layout", "show", "nine", "--plot", str(tmp_path / "nine.png")])
    assert shown.exit_code == 0 and "1.5811" in shown.output and "in w'" in shown.output
    assert (tmp_path / "nine.png").stat().st_size > 10_000
    rows = json.loads(run.invoke(app, ["layout", "compare", "--json"]).output)
    assert [row["name"] for row in rows] == list(LAYOUTS) and rows[0]["gdop"] == pytest.approx(
        1.06066, abs=1e-5
    )
    wrong = run.invoke(app, ["layout", "show", "cubes"])
    assert wrong.exit_code != 0


def test_optimise_writes_a_layout_that_can_be_used(tmp_path):
    out = tmp_path / "best.toml"
    said = CliRunner().invoke(
        app, ["layout", "optimise", "--starts", "2", "--out", str(out), "--json"]
    )
    assert said.exit_code == 0, said.output
    values = json.loads(said.output)
    assert catalogue.load(out).gdop == pytest.approx(values["found"]["gdop"], rel=1e-6)
    assert values["cube"]["gdop"] == pytest.approx(1.06066, abs=1e-5)
