"""A person's own curves over what a device sends, and the stretch of time that charts show."""

import json
import re
import time
from types import SimpleNamespace
from urllib.parse import urlencode

import numpy as np
import pytest
import viser
from hypothesis import given
from hypothesis import strategies as st
from support.feeder import Feeder

from dashboard.data.channels import between, channels, derived, judged
from dashboard.data.store import Store
from dashboard.scene.panels import Snapshot
from dashboard.scene.panels.motion.derived import Derived
from dashboard.scene.panels.motion.spectrum import Spectrum
from dashboard.scene.span import Span
from dashboard.scene.workspaces import Wish
from dashboard.web.views import VIEW
from logs.figures.expression import MOST_CHARACTERS, MOST_CURVES, read

LINE = "norm(omega_x, omega_y, omega_z)"


class Into:
    """Publishers that put into a store."""

    def __init__(self, store):
        self._store = store

    def put(self, topic, device, message, estimator=""):
        self._store.put(topic, device, estimator, message)


@pytest.fixture(scope="module")
def store():
    filled = Store()
    feeder = Feeder(Into(filled))
    for k in range(600):
        feeder.cube(k * 0.01)
        feeder.drive(k * 0.01)
    return filled


def test_every_table_of_a_device_has_names_and_the_leading_ones_stand_alone(store):
    cube, car = (channels(store.device(name)) for name in ("cube-01", "car-01"))
    assert {"omega_z", "least_squares_omega_z", "a4_z", "truth_omega_x", "nis"} <= set(cube)
    assert {"gyro_omega_x", "omega_x", "ekf_p_north", "gnss_p_east"} <= set(car)
    assert cube["omega_z"].estimator == "products-ekf" and cube["omega_z"].unit == "°/s"
    assert all(name == one.name and re.fullmatch(r"[a-z]\w*", name) for name, one in cube.items())


def test_a_derived_curve_is_what_its_channels_make_of_it(store):
    device = store.device("cube-01")
    drawn = derived(device, read(LINE), 0.0, 10.0, channels(device))
    t, rows = device.window("rate", "products-ekf", 0.0, 10.0)
    wanted = np.degrees(np.sqrt(np.sum(rows["omega_ib_b"] ** 2, axis=1)))
    np.testing.assert_array_equal(drawn.t, t)
    np.testing.assert_allclose(drawn.y, wanted, rtol=1e-12)
    assert drawn.unit == "°/s"
    found = judged(device, [LINE, "omega_x + a1_x", "omega_x + a1_x [k]", "a1_q"])
    assert [one["unit"] for one in found] == ["°/s", "", "k", ""]
    assert ["has no unit" in found[1]["fault"], "no channel a1_q" in found[3]["fault"]] == [
        True
    ] * 2


@given(
    st.lists(st.floats(0, 10), min_size=2, max_size=40, unique=True),
    st.lists(st.floats(-1, 11), min_size=1, max_size=40),
)
def test_nothing_is_made_up_across_a_gap(times, at):
    """A value between two neighbours near by, or at a sample, else none."""
    t, at = np.sort(times), np.sort(at)
    found = between(at, t, 2.0 * t)
    known = np.isfinite(found)
    np.testing.assert_allclose(found[known], 2.0 * at[known], atol=1e-9)
    limit = max(0.25, 5.0 * float(np.median(np.diff(t)))) if len(t) > 2 else 0.25
    for when in at[known]:
        before, after = t[t <= when].max(), t[t >= when].min()
        assert after - before <= limit + 1e-12


def snapshot(store, lines, t0=0.0):
    device = store.device("cube-01")
    return Snapshot(
        store, device, t0, device.t_newest, time.monotonic(), True, derived=tuple(lines)
    )


def test_the_page_draws_every_line_that_is_right_and_says_what_is_wrong_with_the_others(store):
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        page = Derived(SimpleNamespace(gui=server.gui), server.gui.add_folder("page"))
        page.update(snapshot(store, []))
        assert "omega_z" in page._top.content and not page._charts
        page.update(snapshot(store, [LINE, "omga_z <i>", "a1_x * 2 [g]"]))
        drawn = {key: chart.name.title for key, chart in page._charts.items()}
        assert drawn == {"derived0": LINE, "derived2": "a1_x * 2"}
        assert page._charts["derived2"].name.unit == "g"
        assert "&lt;i&gt;" in page._top.content and "<i>" not in page._top.content
        spectrum = Spectrum(SimpleNamespace(gui=server.gui), server.gui.add_folder("spectrum"))
        spectrum.update(snapshot(store, [LINE]))
        assert LINE in spectrum._choice.options
        spectrum._choice.value = LINE
        spectrum.update(snapshot(store, [LINE]))
        assert "°/s/√Hz" in spectrum._headings["psd"].content
    finally:
        server.stop()


def test_a_zoom_stays_where_it_is_while_data_come_in():
    store = Store()
    feeder = Feeder(Into(store))
    for k in range(300):
        feeder.cube(k * 0.01)
    device = store.device("cube-01")
    utc0, span = device.utc0_ns * 1e-9, Span()
    wish = Wish.of(f"zoom={utc0 + 1.0:.4f}_{utc0 + 1.5:.4f}")
    span.zoom = wish.zoom
    assert span.limits(device) == pytest.approx((1.0, 1.5), abs=1e-3)
    for k in range(300, 600):
        feeder.cube(k * 0.01)
    assert span.limits(device) == pytest.approx((1.0, 1.5), abs=1e-3)
    assert span.stated(device)["kept"]
    span.zoom = Wish.of(f"zoom={utc0 - 900:.4f}_{utc0 - 800:.4f}").zoom
    assert not span.stated(device)["kept"], "what is no longer held is said"
    span.zoom = Wish.of("zoom=none").zoom
    assert span.limits(device)[1] == device.t_newest


@given(st.text(max_size=60))
def test_no_zoom_is_too_strange_to_be_asked(text):
    zoom = Wish.of(urlencode({"zoom": text})).zoom
    assert zoom is None or zoom == () or (len(zoom) == 2 and zoom[0] <= zoom[1])


def test_the_longest_arrangement_is_kept_as_it_is_linked():
    """What a browser's URLSearchParams makes of the longest lines there may be."""
    longest = ";".join(["(" * (MOST_CHARACTERS - 1) + str(k) for k in range(MOST_CURVES)])
    link = urlencode({"w": "watch", "p": "derived", "derived": longest + "**"}, safe="*")
    assert VIEW.fullmatch(link) and len(json.dumps(link)) < 6000
