"""The store behind the dashboard and the scene made from it: real messages over a real router, a
real viser server.
"""

import contextlib
import html as html_module
import json
import re
import time
import urllib.request
from types import SimpleNamespace

import numpy as np
import pytest
import viser
from support.feeder import UTC0_NS, Feeder, cube_attitude
from support.waiting import until

from dashboard.data.feed import Feed
from dashboard.data.pose import ned_from_geodetic
from dashboard.data.replayed import Replayed
from dashboard.data.ring import Ring, gap_limit
from dashboard.data.store import DEVICES, ESTIMATORS, Store
from dashboard.data.tables import Column, Table
from dashboard.data.track import Track
from dashboard.desk import Desk
from dashboard.scene.drawing import camera, series
from dashboard.scene.drawing import geometry as geo
from dashboard.scene.drawing.drawn import Curve, Name, _data, drawn
from dashboard.scene.drawing.palette import estimator_colour, number
from dashboard.scene.panels import PAGES, Snapshot
from dashboard.scene.panels.base import Panel
from dashboard.scene.panels.device.devices import Devices, counts
from dashboard.scene.service import SceneError, start
from dashboard.scene.view import OWN_INPUTS, View
from inertial.rotation import from_matrix, rotate
from messages.bus.orders import OrderError
from messages.bus.session import BusSettings, Publishers, open_client, open_router
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp

PAIR = Table(1.0, (Column("up", "m"), Column("both", "m", 2))).dtype()


class Direct:
    """Stands where the feeder wants publishers and puts straight into a store."""

    def __init__(self, store: Store) -> None:
        self.store = store

    def put(self, topic, device, message, estimator="") -> None:
        self.store.put(topic, device, estimator, message)


class Flat(Direct):
    """As Direct, of a receiver that gives neither heights nor velocities."""

    def put(self, topic, device, message, estimator="") -> None:
        if topic in (tp.GNSS, tp.NAV):
            message.height_m, message.height_reference = np.nan, pb.HEIGHT_REFERENCE_UNKNOWN
        if topic is tp.GNSS:
            message.ClearField("v_n_mps")
        if topic is tp.NAV:
            message.p_ned_m[2] = message.origin_height_m = np.nan
            message.sigma[8], message.position_covariance[8] = 1e4, 1e8
        if topic is tp.INNOVATION:
            message.value[2] = message.value[5] = np.nan
        super().put(topic, device, message, estimator)


@pytest.fixture
def store() -> Store:
    return Store()


@pytest.fixture
def bus(free_port) -> BusSettings:
    endpoint = f"tcp/127.0.0.1:{free_port}"
    return BusSettings(router=endpoint, listen=[endpoint])


@pytest.fixture
def nobody() -> Desk:
    """A desk without a router."""
    return Desk(None, "gyrofree")


# --- ring and decimation


def test_ring_keeps_the_newest_rows_in_order():
    ring = Ring(PAIR, capacity=10)
    for k in range(25):
        ring.append(k * 0.1, up=k, both=[[k, -k]])
        rows = ring.window(0.0, 99.0)
        first = max(0, k - 9)
        assert np.allclose(rows["t"], np.arange(first, k + 1) * 0.1)
        assert rows["up"].tolist() == list(range(first, k + 1)) and rows["both"][-1, 1] == -k


@pytest.mark.parametrize("size", [1, 3, 10, 24])
def test_ring_takes_rows_one_by_one_or_many_at_once(size):
    """A whole batch is the same as its rows, also where it is larger than the ring."""
    ring, single = Ring(PAIR, capacity=10), Ring(PAIR, capacity=10)
    t, both = np.arange(48) * 0.5, np.random.default_rng(5).normal(size=(48, 2))
    for first in range(0, 48, size):
        ring.append(t[first : first + size], both=both[first : first + size])
    for moment, pair in zip(t, both, strict=True):
        single.append(moment, both=pair)
    rows = ring.rows()
    assert rows.tobytes() == single.rows().tobytes()
    assert np.array_equal(rows["both"], both[-10:]) and np.isnan(rows["up"]).all()


def test_ring_gives_only_the_window_and_drops_rows_out_of_order():
    one, many = Ring(PAIR, capacity=100), Ring(PAIR, capacity=100)
    disorder = np.array([0.0, 1.0, 2.0, 1.5, 1.7, 3.0])
    for t in disorder:
        one.append(t, up=t)
    many.append(disorder, up=disorder)
    for ring in (one, many):
        assert ring.rows()["up"].tolist() == [0.0, 1.0, 2.0, 3.0]
        assert ring.window(1.0, 2.0)["t"].tolist() == [1.0, 2.0]


def test_decimation_keeps_every_extreme():
    t = np.arange(30000) * 0.01
    y = np.sin(t)
    y[12345], y[23456] = 40.0, -50.0
    edges, x = series.grid(0.0, 300.0)
    values, filled = series.decimate(t, y, edges)
    assert len(values) == len(x) == series.POINTS and filled.all()
    assert values.max() == 40.0 and values.min() == -50.0
    assert abs(x[values.argmax()] - t[12345]) < 300.0 / series.POINTS * 2


def test_decimation_follows_the_direction_in_which_the_series_moves():
    edges, _ = series.grid(0.0, 10.0, points=20)
    t = np.arange(0, 10, 0.01)
    assert (np.diff(series.decimate(t, t, edges)[0]) > 0).all()
    assert (np.diff(series.decimate(t, -t, edges)[0]) < 0).all()


def test_decimation_of_few_samples_interpolates_and_never_gives_nan():
    edges, x = series.grid(0.0, 10.0)
    values, filled = series.decimate(np.array([2.0, 8.0]), np.array([1.0, 4.0]), edges)
    assert np.isfinite(values).all() and filled.sum() == 2
    assert values[0] == 1.0 and values[-1] == 4.0 and abs(np.interp(5.0, x, values) - 2.5) < 0.02
    values, filled = series.decimate(np.array([1.0]), np.array([np.nan]), edges)
    assert not filled.any() and not values.any()


def test_gap_mask_marks_the_gap_and_nothing_else():
    t = np.concatenate([np.arange(0, 4, 0.01), np.arange(6, 10, 0.01)])
    edges, x = series.grid(0.0, 10.0)
    mask = series.gap_mask(t, edges, gap_limit(t))
    assert mask[(x > 4.05) & (x < 5.95)].all() and not mask[(x < 3.95) | (x > 6.05)].any()


def test_gap_mask_marks_silence_at_the_ends():
    edges, x = series.grid(0.0, 10.0)
    mask = series.gap_mask(np.arange(3, 7, 0.01), edges, 0.25)
    assert mask[x < 2.9].all() and mask[x > 7.1].all() and not mask[(x > 3.1) & (x < 6.9)].any()
    assert series.gap_mask(np.empty(0), edges, 0.25).all()


def test_chart_data_are_of_one_length_finite_and_end_with_the_mask():
    t = np.arange(0, 10, 0.01)
    curves = [
        Curve("a", "#56B4E9", t, np.sin(t), half=1e6 * np.ones_like(t)),
        Curve("b", "#D55E00", t[::7], t[::7]),
    ]
    data = _data(curves, 0.0, 10.0, 0)
    assert len(data) == 1 + 3 + 1 + 2 and {len(array) for array in data} == {series.POINTS}
    assert all(np.isfinite(array).all() for array in data) and not data[-1].any()
    assert data[2].max() < 20.0  # a band without bound does not press the curves flat


def test_what_is_not_vouched_for_is_dotted_and_a_band_that_is_not_known_is_none():
    t = np.arange(0, 10, 0.01)
    blind, half = (t > 4.0) & (t < 6.0), np.where((t > 7.0) & (t < 8.0), np.nan, 1.0)
    curve = Curve("a", "#56B4E9", t, np.sin(t), half=half, sight=np.where(blind, 2, 0))
    shown = drawn(Name("rate", "°/s"), [curve], 0.0, 10.0, True).heading
    told = json.loads(html_module.unescape(re.search(r'data-chart="([^"]*)"', shown)[1]))
    assert told["faint"] == {"a": [[pytest.approx(4.01), pytest.approx(6.0)]]}
    assert told["holes"].keys() == {"a +3σ", "a −3σ"}
    assert told["holes"]["a +3σ"] == [[pytest.approx(7.0), pytest.approx(8.0)]]


def test_a_preview_is_greyed_by_its_own_pauses(store):
    for k in range(4):
        store.preview_hz = 1
        truth = pb.Truth(header=pb.Header(utc_ns=UTC0_NS + k * 10**9), q_nb=[1, 0, 0, 0])
        store.put(tp.TRUTH, "cube-01", "", truth, arrived=100.0 + k)
        accel = pb.AccelBatch(header=truth.header, axes=12, f_mps2=[0.0] * 12, period_s=0.01)
        store.put(tp.ACCEL, "cube-01", "", accel, arrived=100.0 + k)
    device = store.device("cube-01")
    assert not device.stale("truth", now=105.9) and device.stale("truth", now=106.1)


# --- geometry


@pytest.mark.parametrize(
    "p_n, shown",
    [
        ((1, 0, 0), (0, 1, 0)),
        ((0, 1, 0), (1, 0, 0)),
        ((0, 0, 1), (0, 0, -1)),
        ((3, 2, -5), (2, 3, 5)),
    ],
)
def test_world_turns_north_east_down_into_east_north_up(p_n, shown):
    assert np.allclose(rotate(geo.Q_DISPLAY_N, p_n), shown)


def test_cube_on_its_table_stands_upright_on_the_screen():
    up_b = rotate(np.array(cube_attitude(0.7)), np.array([0.0, 0.0, 1.0]))
    assert rotate(np.array(geo.Q_DISPLAY_N), up_b)[2] > 0.999


def test_quaternion_refuses_what_is_none():
    assert geo.quaternion([]) is None and geo.quaternion([0, 0, 0, 0]) is None
    assert geo.quaternion([float("nan"), 0, 0, 1]) is None
    assert geo.quaternion([2, 0, 0, 0]) == (1.0, 0.0, 0.0, 0.0)


def test_matrix_to_quaternion_inverts_rotate():
    random = np.random.default_rng(3)
    for q in random.normal(size=(50, 4)):
        q /= np.linalg.norm(q)
        c = np.column_stack([rotate(q, axis) for axis in np.eye(3)])
        back = np.array(from_matrix(c))
        assert min(np.abs(back - q).max(), np.abs(back + q).max()) < 1e-9


def test_ellipsoid_axes_are_three_standard_deviations():
    axes, q = geo.ellipsoid(np.diag([4.0, 9.0, 1.0]).ravel())
    assert np.allclose(sorted(axes), [3.0, 6.0, 9.0])
    longest = rotate(np.array(q), np.eye(3)[int(np.argmax(axes))])
    assert np.allclose(np.abs(longest), [0, 1, 0])
    assert geo.ellipsoid([]) is None and geo.ellipsoid([float("nan")] * 9) is None


def test_geodetic_differences_agree_with_the_length_of_a_degree():
    p = ned_from_geodetic(45.001, 7.0, 0.0, (45.0, 7.0, 0.0))
    assert abs(p[0] - 111.132) < 0.01  # a degree of latitude at 45 degrees is 111.132 km
    p = ned_from_geodetic(0.0, -179.9995, 12.0, (0.0, 179.9995, 10.0))
    assert abs(p[1] - 111.320) < 0.01 and p[2] == -2.0  # across the date line, and up is negative


@pytest.mark.parametrize("view", [camera.CUBE, camera.VEHICLE])
@pytest.mark.parametrize(
    "aspect, sheet, height",
    [(1.6, False, 0.5), (0.45, False, 0.5), (0.46, True, camera.PHONE_CENTRE)],
)
def test_camera_shows_the_centre_where_it_is_not_covered_and_the_whole_width(
    view, aspect, sheet, height
):
    fov = np.radians(75.0)
    position, look_at = camera.aim(view, fov, aspect, sheet)
    ahead = (look_at - position) / np.linalg.norm(look_at - position)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up, scale = np.cross(right, ahead), np.tan(fov / 2)

    def seen(point):
        v = point - position
        return v @ right / (v @ ahead) / scale / aspect, 0.5 - v @ up / (v @ ahead) / scale / 2

    x, y = seen(np.array(view.centre))
    assert abs(x) < 1e-9 and abs(y - height) < 1e-9
    assert abs(seen(view.centre + view.half_width * right)[0]) <= 1.0 + 1e-9


def test_track_thins_itself_and_stays_a_line():
    track = Track(spacing=1.0)
    for k in range(100_000):
        track.add((float(k), 0.0, 0.0))
    assert len(track.pieces) <= Track.PIECES and track.thinned >= 1
    for before, after in zip(track.pieces, track.pieces[1:], strict=False):
        assert after[0][0] - before[-1][0] <= 2 * track.spacing
    assert track.pieces[0][0] == (0.0, 0.0, 0.0) and track.last()[0] > 99_000


# --- store


def test_store_takes_a_cube_in(store):
    feeder = Feeder(Direct(store))
    for k in range(800):
        feeder.cube(k * 0.01)
    device = store.device("cube-01")
    assert not device.is_vehicle and device.estimators("rate") == ["products-ekf", "least-squares"]
    t, rows = device.window("rate", "products-ekf", 6.0, 7.0)
    assert 99 <= len(t) <= 102 and abs(np.degrees(rows["omega_ib_b"][:, 2].mean()) - 171) < 1
    assert device.window("accel", "", 0, 99)[1]["f"].shape == (800, 12)


def test_store_takes_a_drive_in_and_puts_fixes_into_the_frame_of_the_trajectory(store):
    feeder = Feeder(Direct(store))
    for k in range(400):
        feeder.drive(k * 0.05)
    device = store.device("car-01")
    assert device.is_vehicle and device.estimators("nav") == ["ekf"]
    t, rows = device.window("nav", "ekf", 0, 99)
    fix_t, fixes = device.window("gnss", "", 0, 99)
    at_fix = np.array([np.interp(fix_t, t, rows["p_n"][:, k]) for k in range(3)]).T
    assert (
        np.median(np.abs(fixes["p_n"] - at_fix)) < 1.0
    )  # the median: a few fixes are wild on purpose
    assert device.tracks["nav/ekf"].last() is not None and device.tracks["fixes"].last() is not None


def test_only_rejected_fixes_are_marked_and_they_lie_where_the_fix_is(store):
    feeder = Feeder(Direct(store))
    for k in range(160):  # the feeder has a wild fix rejected at steps 50 and 150
        feeder.drive(k * 0.05)
    device = store.device("car-01")
    (rejected,) = device.tracks["rejected"].pieces
    (fixes,) = device.tracks["fixes"].pieces
    assert len(rejected) == 2 and set(rejected) <= set(fixes)
    header = pb.Header(device="car-01", utc_ns=UTC0_NS + 9_000_000_000)
    withheld = pb.Innovation(
        header=header, estimator="ekf", for_sequence=155, error_to_reference=[1.0, 2.0, 3.0]
    )
    store.put(tp.INNOVATION, "car-01", "ekf", withheld)
    assert len(rejected) == 2


def test_a_rejection_filled_in_from_before_may_be_the_first_that_is_heard(store):
    feeder = Feeder(Direct(store))
    feeder.cube(0.0)
    rejected = pb.Innovation(header=pb.Header(device="cube-01", utc_ns=UTC0_NS), nis=30.0)
    store.put_late("cube-01", [(tp.INNOVATION, name, rejected) for name in ("kf", "ekf")], False)
    device = store.device("cube-01")
    assert device.estimators("innovation") == ["ekf", "kf"]
    assert device.leads("innovation", "ekf") and not device.leads("innovation", "kf")
    assert all(len(device.window("innovation", name, -9, 9)[0]) == 1 for name in ("ekf", "kf"))


def test_values_get_stale_by_their_arrival_not_by_their_time_stamp(store):
    truth = pb.Truth(header=pb.Header(utc_ns=UTC0_NS), q_nb=[1, 0, 0, 0])
    store.put(tp.TRUTH, "cube-01", "", truth, arrived=100.0)
    device = store.device("cube-01")
    assert not device.stale("truth", now=100.9) and device.stale("truth", now=101.1)
    assert device.stale("tacho", now=100.0)  # never heard


def test_a_replay_that_starts_over_forgets_the_old_axis(store):
    feeder = Feeder(Direct(store))
    feeder.cube(0.0)
    feeder.cube(20.0)
    assert store.device("cube-01").t_newest == 20.0
    feeder.cube(0.01)
    assert store.device("cube-01").generation == 0  # one alone may be nonsense
    feeder.cube(0.03)
    device = store.device("cube-01")
    assert device.generation == 1 and device.t_newest < 1.0


def test_malformed_messages_leave_the_store_usable(store):
    header = pb.Header(utc_ns=UTC0_NS)
    store.put(tp.ACCEL, "cube-01", "", pb.AccelBatch(header=header, axes=12, f_mps2=[1.0] * 7))
    store.put(tp.ACCEL, "cube-01", "", pb.AccelBatch(header=header))
    store.put(
        tp.RATE,
        "cube-01",
        "odd",
        pb.RateBatch(header=header, omega_ib_b_radps=[1.0], innovation=[0.0] * 40),
    )
    store.put(tp.NAV, "cube-01", "odd", pb.NavSolution(header=header, mode=3, q_nb=[1.0]))
    assert len(store.device("cube-01").window("rate", "odd", -1, 1)[0]) == 1


def test_a_foreign_publisher_cannot_fill_the_memory(store):
    header = pb.Header(utc_ns=UTC0_NS)
    for k in range(200):
        store.put(tp.LINK, f"board-{k:03d}", "", pb.LinkStatus(header=header))
    store.put(tp.LINK, "No Name", "", pb.LinkStatus(header=header))
    assert len(store.devices) == DEVICES and store.refused == 200 - DEVICES + 1
    for k in range(1000):
        state = pb.EstimatorStatus(header=header)
        store.put(tp.ESTIMATOR, "board-000", f"e{k}", state)
    assert len(store.device("board-000").latest) == ESTIMATORS + 1


# --- panels


class Seen(Panel):
    """Mixed into a page: keeps what would be drawn instead of drawing it."""

    def show(self, key, title, unit, curves, s, **options) -> None:
        self.drawn[key] = (unit, list(curves() if callable(curves) else curves))

    def html(self, content, handle):
        self.text = content
        return None


@pytest.fixture(scope="module")
def server():
    """A real viser server: its own GUI stands for a client's, with the same calls."""
    running = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield running
    running.stop()


@pytest.mark.parametrize("kind", ["cube", "drive", "flat drive", "nothing"])
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.title)
def test_every_page_is_made_from_every_kind_of_device(store, server, page, kind):
    feeder = Feeder(Flat(store) if kind == "flat drive" else Direct(store))
    for k in range(700):
        feeder.cube(k * 0.01) if kind == "cube" else feeder.drive(k * 0.05)
    if kind == "nothing":
        store.devices.clear()
        store.put(
            tp.LINK,
            "car-01",
            "",
            pb.LinkStatus(header=pb.Header(utc_ns=UTC0_NS), message="port is gone"),
        )
    (device,) = store.devices.values()
    panel = type("Seen" + page.__name__, (Seen, page), {})(
        server, server.gui.add_folder(page.title)
    )
    panel.drawn, panel.text = {}, ""
    panel.update(Snapshot(store, device, 0.0, max(device.t_newest, 1.0), time.monotonic(), True))
    if kind != "nothing":
        assert panel.drawn or panel.text
    for unit, curves in panel.drawn.values():
        assert unit
        for curve in curves:
            assert len(curve.t) == len(curve.y) and (
                curve.half is None or len(curve.half) == len(curve.t)
            )


def test_counts_of_an_estimator_are_rows_and_anything_else_it_says_is_an_alert(store):
    assert counts("fixes used 1315, fixes late 2") == {"used": 1315, "late": 2}
    assert counts("") is None and counts("fixes used 3, clock jumped") is None
    header = pb.Header(device="car-01", utc_ns=UTC0_NS)
    status = pb.EstimatorStatus(
        header=header, state="levelling: stand still for 10 s", message="fixes used 1315"
    )
    panel = type("SeenDevices", (Seen, Devices), {})(None, None)

    def text():
        store.put(tp.ESTIMATOR, "car-01", "ekf", status)
        panel.update(Snapshot(store, store.device("car-01"), 0.0, 1.0, time.monotonic(), True))
        return panel.text

    assert (
        "gf-alert" not in text()
        and "fixes used</td>" in text()
        and "stand still for 10 s" in text()
    )
    status.message = "clock jumped"
    assert '<p class="gf-alert">ekf: clock jumped</p>' in text()


def test_colours_and_numbers():
    assert estimator_colour("a", ["a", "b"]) != estimator_colour("b", ["a", "b"])
    assert number(-0.01) == "0.0" and number(None, 1, "m") == "– m" and number(float("nan")) == "–"
    assert number(-1234.5, 1, "m") == "−1\u202f234.5 m"


# --- bus and server


def test_feed_takes_messages_from_the_bus(bus, store):
    watched = SimpleNamespace(is_set=lambda: True)
    with open_router(bus), open_client(bus, timeout_s=20) as session:
        feed, desk = Feed(session, bus.prefix, store, watched), Desk(session, bus.prefix)
        try:
            assert desk.connected
            feeder = Feeder(Publishers(session, bus.prefix))
            feeder.cube(0.0)
            until(lambda: not feeder.cube(feeder._k * 0.01) and store.device("cube-01") is not None)
            for topic, estimator in (("accel", ""), ("truth", ""), ("rate", "least-squares")):
                until(lambda key=(topic, estimator): key in store.device("cube-01").latest)
            feeder.recorder(1.0)
            until(lambda: store.recorder is not None)
            with pytest.raises(OrderError, match="gyrofree record"):
                desk.recorder(pb.RecorderCommand(), timeout_s=0.5)
        finally:
            feed.stop()


def test_scene_is_served_and_idle_without_browsers(store, nobody):
    handle = start(SimpleNamespace(viser_port=0), store, nobody)
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{handle.port}/", timeout=20) as page:
            assert page.status == 200 and b"<html" in page.read(2000)
        assert handle.clients == 0
    finally:
        handle.stop()


def test_a_port_in_use_is_an_error_with_its_remedy(store, nobody, free_port):
    first = start(SimpleNamespace(viser_port=free_port), store, nobody)
    try:
        with pytest.raises(SceneError, match=f"viser_port {free_port}: already in use"):
            start(SimpleNamespace(viser_port=free_port), store, nobody)
    finally:
        first.stop()


def test_every_input_is_an_order_or_named_as_ones_own(server, store, nobody):
    """A viewer may use inputs by their labels, so no order may have one of those."""
    before = set(server.gui._gui_input_handle_from_uuid)
    client = SimpleNamespace(
        gui=server.gui, scene=server.scene, camera=None, atomic=contextlib.nullcontext
    )
    view = View(client, store, nobody)
    made = server.gui._gui_input_handle_from_uuid.items()
    inputs = [handle for uuid, handle in made if uuid not in before]
    orders = [handle for handle in inputs if handle in view.orders]
    own = [handle for handle in inputs if handle not in view.orders]
    assert len(orders) == len(view.orders) > 15 and len(own) > 4
    assert not {handle.label for handle in orders} & OWN_INPUTS
    assert {handle.label for handle in own} == OWN_INPUTS


def test_the_scene_opens_no_public_tunnel(store, nobody):
    handle = start(SimpleNamespace(viser_port=0), store, nobody)
    try:
        assert handle._server.request_share_url() is None and handle._server._share_tunnel is None
    finally:
        handle.stop()


@pytest.mark.browser
def test_browser_shows_the_cube_as_the_truth_has_it(store, nobody, chromium):
    feeder = Feeder(Direct(store))
    for k in range(700):
        feeder.cube(k * 0.01)
    handle = start(SimpleNamespace(viser_port=0), store, nobody)
    try:
        page = chromium.new_page(viewport={"width": 800, "height": 500})
        errors = []
        page.on(
            "console",
            lambda message: errors.append(message.text) if message.type == "error" else None,
        )
        page.goto(f"http://127.0.0.1:{handle.port}/")
        script = """names => names.map(name => {
            const node = window.__viserMutable?.nodeRefFromName[name];
            return node ? node.quaternion.toArray() : null; })"""
        names = [
            "/world/truth",
            "/world/estimate/products-ekf/body",
            "/world/estimate/least-squares/body",
        ]
        device = store.device("cube-01")
        wanted = [device.get("truth").message.q_nb]
        wanted += [
            device.get("rate", name).message.q_nb for name in ("products-ekf", "least-squares")
        ]

        def near() -> bool:
            found = page.evaluate(script, names)
            if None in found:
                return False
            dots = [
                abs(np.dot([w, x, y, z], q)) for (x, y, z, w), q in zip(found, wanted, strict=True)
            ]
            return min(dots) > 0.99999

        until(near, "the attitudes of the store")
        assert page.get_by_text("SIMULATED").first.is_visible()
        assert not errors, json.dumps(errors)
        page.close()
    finally:
        handle.stop()


def test_what_comes_late_takes_its_place_and_is_marked():
    """A hole in the rows of a chart is filled by late messages; an older past extends the axis to
    the left.
    """
    store = Store()

    def batch(k: int) -> pb.AccelBatch:
        header = pb.Header(device="cube", sequence=k, run=1, utc_ns=10**18 + k * 100_000_000)
        return pb.AccelBatch(header=header, period_s=0.1, axes=1, f_mps2=[float(k)])

    for k in [*range(100, 120), *range(150, 160)]:
        store.put(tp.ACCEL, "cube", "", batch(k))
    device = store.device("cube")
    store.put_late("cube", [(tp.ACCEL, "", batch(k)) for k in range(120, 150)], repaired=True)
    t, rows = device.window("accel", "", -1.0, 10.0)
    assert list(rows["f"][:, 0]) == list(range(100, 160)) and np.allclose(t, np.arange(60) * 0.1)
    assert len(device.late) == 1 and np.allclose(device.late[0], [2.0, 4.9])
    store.put_late("cube", [(tp.ACCEL, "", batch(k)) for k in range(40, 110)], repaired=False)
    t, rows = device.window("accel", "", -100.0, 10.0)
    assert (
        list(rows["f"][:, 0]) == list(range(40, 160))
        and device.t_first == pytest.approx(-6.0)
        and len(device.late) == 1
    )
    assert device.get("accel").message.header.sequence == 159
    edges = np.linspace(0.0, 6.0, 13)
    assert list(series.stretch_mask(device.late, edges)) == [0.0] * 8 + [1.0] * 12 + [0.0] * 4


def test_a_replay_that_is_paused_does_not_age():
    replay = Replayed()
    assert replay.state("cube-replay", 10.0) == "ended" and replay.state("cube", 10.0) == ""
    replay.take(pb.ReplayStatus(session="a"), 10.0)
    assert replay.began == 10.0 and replay.clock("cube-replay", 10.5) == 10.5
    for now in (11.0, 12.0):
        replay.take(pb.ReplayStatus(session="a", paused=True), now)
    assert replay.state("cube-replay", 12.5) == "paused"
    assert replay.clock("cube-replay", 12.5) == 11.0 and replay.clock("cube", 12.5) == 12.5
    replay.take(pb.ReplayStatus(session="a"), 13.0)
    assert (
        replay.state("cube-replay", 13.5) == "playing" and replay.clock("cube-replay", 13.5) == 13.5
    )
    replay.take(pb.ReplayStatus(session="b"), 14.0)
    assert replay.began == 14.0


def test_the_device_of_a_replay_is_one_heard_since_it_began():
    store = Store()
    header = pb.Header(device="cube-replay", utc_ns=10**18)
    store.put(tp.ACCEL, "cube-replay", "", pb.AccelBatch(header=header), arrived=5.0)
    store.put(tp.REPLAY, "", "", pb.ReplayStatus(session="a"), arrived=10.0)
    store.put(tp.ACCEL, "cube", "", pb.AccelBatch(header=header), arrived=11.0)
    assert store.replay.device(store.devices) is None
    store.put(tp.ACCEL, "cube-replay", "", pb.AccelBatch(header=header), arrived=12.0)
    assert store.replay.device(store.devices) == "cube-replay"
