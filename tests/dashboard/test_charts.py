"""Charts of the sessions' pages in real Chromium: drawn, zoomed, gaps left open, both themes."""

import contextlib
import shutil

import pytest
from playwright.sync_api import expect
from support.browser import DESKTOP, PHONE
from support.browser import visit as opened
from support.front_door import open_door
from support.table_session import SESSION, table_root

from sessions.library.annotations import SessionNote, add_note
from sessions.recording.mcap_log import read
from sessions.replay.rerun import write_session

pytestmark = [pytest.mark.browser, pytest.mark.timeout(300)]

HOLED = "20240101-000004-holed"  # the same run without 10 to 15 s
HOLE_S = (10.0, 15.0)
# Share of a chart's columns between two shares of its width that hold a saturated pixel (a line's).
COLOURED = """([name, from, to]) => {
  const figure = document.querySelector(`figure[data-plot="${name}"]`);
  const canvas = figure.querySelector('canvas'), over = figure.querySelector('.u-over');
  const c = canvas.getBoundingClientRect(), o = over.getBoundingClientRect();
  const scale = canvas.width / c.width;
  const left = Math.round((o.left - c.left + from * o.width) * scale);
  const width = Math.round((to - from) * o.width * scale);
  const data = canvas.getContext('2d').getImageData(left, 0, width, canvas.height).data;
  const columns = new Set();
  for (let k = 0; k < data.length; k += 4) {
    const rgb = data.slice(k, k + 3);
    if (data[k + 3] > 100 && Math.max(...rgb) - Math.min(...rgb) > 60) columns.add((k / 4) % width);
  }
  return columns.size / width;
}"""


@pytest.fixture(scope="module")
def door(tmp_path_factory):
    folder = tmp_path_factory.mktemp("door")
    root = folder / "sessions"
    shutil.copytree(table_root() / SESSION, root / SESSION)
    rows = list(read(root / SESSION / "recording.mcap"))
    begin_ns = rows[0].log_ns
    outside = (
        (row.log_ns, row.key, row.payload)
        for row in rows
        if not HOLE_S[0] < (row.log_ns - begin_ns) / 1e9 < HOLE_S[1]
    )
    write_session(root, HOLED, outside, "", {})
    add_note(root / SESSION, SessionNote(text="a nudge", author="anna", at_s=12.0))
    with open_door(folder, scene=False) as door:
        yield door
        door.front.readings.close()


@pytest.fixture
def visit(chromium, door):
    """Open a page signed in; at the end nothing may have complained, the content policy neither."""
    with contextlib.ExitStack() as stack:
        heard = []

        def open_page(path, viewport=DESKTOP, scheme="dark", **options):
            page, said = stack.enter_context(
                opened(chromium, door, "otto", path, viewport, color_scheme=scheme, **options)
            )
            heard.append(said)
            page.wait_for_selector("body[data-plotted=done]")
            page.wait_for_selector("figure[data-plot='rate z'] .u-over")
            return page

        yield open_page
        assert not any(heard), heard


def plot(page, name):
    return page.locator(f"figure[data-plot='{name}']")


def asked(page, act):
    """The window that the page asks curves for after act()."""
    with page.expect_request(lambda request: "/api/compare?" in request.url) as request:
        act()
    query = dict(part.split("=") for part in request.value.url.split("?")[1].split("&"))
    return [float(query[name]) for name in ("begin", "end")]


def drag(page, name, begin, end):
    box = plot(page, name).locator(".u-over").bounding_box()
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + begin * box["width"], y)
    page.mouse.down()
    page.mouse.move(box["x"] + end * box["width"], y, steps=5)
    assert plot(page, name).locator(".u-select").bounding_box()["width"] == pytest.approx(
        (end - begin) * box["width"], abs=3.0
    )
    page.mouse.up()


def test_a_drag_zooms_all_charts_and_a_double_click_shows_all_of_it(visit):
    page = visit(f"/sessions/{SESSION}")
    begin, end = asked(page, lambda: drag(page, "rate x", 0.25, 0.5))
    assert (begin, end) == (pytest.approx(7.5, abs=0.2), pytest.approx(15.0, abs=0.2))
    over = plot(page, "angle z").locator(".u-over")
    box = over.bounding_box()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 20)
    for name in ("rate x", "rate y", "error z", "angle z"):  # one cursor, one window for all
        expect(plot(page, name).locator("output")).to_contain_text("11.2")
    plot(page, "rate z").locator(".chart").focus()
    left = asked(page, lambda: page.keyboard.press("ArrowLeft"))
    assert left == [
        pytest.approx(begin - (end - begin) / 4, abs=0.01),
        pytest.approx(end - (end - begin) / 4, abs=0.01),
    ]
    closer = asked(page, lambda: page.keyboard.press("+"))
    assert closer[1] - closer[0] == pytest.approx((end - begin) / 2, abs=0.01)
    whole = asked(page, over.dblclick)
    assert whole[1] - whole[0] == pytest.approx(29.99, abs=0.1)


def test_a_click_names_the_moment_for_a_remark(visit):
    page = visit(f"/sessions/{SESSION}")
    over = plot(page, "rate x").locator(".u-over")
    over.click(position={"x": over.bounding_box()["width"] / 3, "y": 30})
    moment = float(page.locator("#note input[name=at_s]").input_value())
    assert moment == pytest.approx(10.0, abs=0.1) and f"t={moment:g}" in page.url


def test_a_gap_stays_open_and_a_hidden_line_goes(visit):
    page = visit(f"/sessions/{HOLED}")
    inside, before = (0.36, 0.48), (0.05, 0.3)  # shares of 30 s
    for name in ("rate x", "rate y", "angle z"):
        assert page.evaluate(COLOURED, [name, *inside]) == 0.0
        assert page.evaluate(COLOURED, [name, *before]) > 0.95
    for line in page.locator(".legend button").all():
        line.click()
    assert page.locator(".legend [aria-pressed=true]").count() == 0
    assert page.evaluate(COLOURED, ["rate x", *before]) == 0.0


@pytest.mark.parametrize("path", [f"/sessions/{SESSION}", f"/compare?ids={SESSION},{HOLED}"])
def test_on_a_phone_no_page_is_wider_than_the_screen(visit, path):
    page = visit(path, PHONE, "light", has_touch=True, is_mobile=True)
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    assert page.evaluate(COLOURED, ["rate x", 0.0, 0.3]) > 0.7  # dots where a filter is blind


def test_axes_follow_the_theme(visit):
    """Their words are drawn, so a stylesheet alone does not change them."""
    page = visit(f"/sessions/{SESSION}")
    darkest = """() => { const c = document.querySelector("figure[data-plot='rate x'] canvas");
      const d = c.getContext('2d').getImageData(0, 0, 50, c.height).data;
      return Math.min(...Array.from({length: d.length / 4}, (_, k) => d[4 * k + 3] > 200
        ? d[4 * k] + d[4 * k + 1] + d[4 * k + 2] : 765)); }"""
    in_dark = page.evaluate(darkest)
    page.get_by_label("Menu of otto").click()
    page.locator("[data-theme-toggle]").click()
    assert page.evaluate(darkest) < in_dark - 100


def test_two_cursors_measure_what_is_recorded_and_escape_takes_them_away(visit):
    page = visit(f"/sessions/{SESSION}")
    chart = plot(page, "rate z").locator(".chart")
    chart.focus()
    with page.expect_response(lambda answer: "cursors=" in answer.url) as answer:
        page.keyboard.press("c")
    (line,) = [one for one in answer.value.json()["lines"] if one["title"] == "products filter"]
    table = plot(page, "rate z").locator(".gf-between")
    expect(table).to_contain_text("of means over 0.01 s")  # some bins hold two samples
    found = line["measured"]["rate"]["z"]
    count = f"{found['n']} of {found['of']}, else {found['word']}" if found["word"] else found["n"]
    row = table.locator("tr", has_text="products filter")
    assert row.locator("td").last.inner_text() == str(count)
    before = table.locator("p").inner_text()
    page.keyboard.press("ArrowRight")
    expect(table.locator("p")).not_to_have_text(before)
    assert page.locator(".gf-between").count() > 3  # the same stretch under every chart
    page.keyboard.press("Escape")
    expect(page.locator(".gf-between")).to_have_count(0)


@pytest.mark.parametrize("kind", ["SVG", "PNG"])
def test_a_figure_is_saved_with_title_unit_and_legend(visit, tmp_path, kind):
    page = visit(f"/sessions/{SESSION}", scheme="dark")
    with page.expect_download() as download:
        plot(page, "rate z").get_by_role("button", name=f"Save the figure as {kind}").click()
    path = tmp_path / download.value.suggested_filename
    download.value.save_as(path)
    if kind == "PNG":
        assert path.read_bytes().startswith(b"\x89PNG") and path.stat().st_size > 20_000
        return
    text = path.read_text()
    for words in ("°/s", "time, s since", "products filter", "tachometer", 'fill="#fff"'):
        assert words in text
    assert text.count("<path") > 5 and "NaN" not in text


ODD = """async () => {
  const { robust } = await import('/static/figure.js');
  const x = Array.from({ length: 300 }, (_, k) => k / 10);
  const y = x.map((t) => Math.sin(t));
  const line = (values) => [{ label: 'a', x, low: values, high: values }];
  const spike = y.with(100, 500), fresh = y.with(299, 500);
  const signal = y.map((v, k) => v + (k > 100 && k < 130 ? 500 : 0));
  const of = (values) => robust(line(values), 0, 30);
  return [of(y), of(spike), of(fresh), of(signal), of(y.map(() => 3))];
}"""


def test_one_outlier_does_not_flatten_the_scale_and_a_signal_is_none(visit):
    plain, spike, fresh, signal, constant = visit(f"/sessions/{SESSION}").evaluate(ODD)
    assert plain is None and fresh is None and signal is None and constant is None
    assert spike["max"] < 1.1 and [(one["x"], one["y"]) for one in spike["odd"]] == [(10, 500)]


def test_a_curve_of_ones_own_is_completed_refused_drawn_saved_and_linked(visit, door, tmp_path):
    page = visit(f"/sessions/{SESSION}")
    page.get_by_text("Curves of your own").click()
    line = page.get_by_role("combobox", name="Expression")
    line.press_sequentially("norm(omega_x, omega_y, ome")
    expect(page.get_by_role("option").first).to_contain_text("°/s")
    line.press("ArrowDown")
    line.press("ArrowDown")
    line.press("ArrowDown")
    line.press("Enter")
    assert line.input_value() == "norm(omega_x, omega_y, omega_z"
    page.get_by_role("button", name="Draw").click()
    expect(page.get_by_role("alert")).to_contain_text("cannot be read")
    line.fill("norm(omega_x, omega_y, omega_z)")
    line.press("Escape")
    page.get_by_role("button", name="Draw").click()
    figure = page.locator("figure[data-own]")
    expect(figure.locator(".u-over")).to_be_visible()
    expect(page.get_by_label("Your curves")).to_contain_text("°/s")
    expect(page.get_by_role("alert")).to_be_hidden()
    with page.expect_download() as download:
        figure.get_by_role("button", name="Save the figure as SVG").click()
    path = tmp_path / "figure.svg"
    download.value.save_as(path)
    text = path.read_text()
    assert "norm(omega_x, omega_y, omega_z)" in text and "s since 2024-01-01" in text
    page.goto(page.evaluate("location.href"))  # the link has it, and so has the person's next visit
    expect(page.locator("figure[data-own] .u-over")).to_be_visible()
    page.goto(f"{door.url}/sessions/{SESSION}")
    expect(page.locator("figure[data-own] .u-over")).to_be_visible()
    page.get_by_role("button", name="Take norm").click()
    expect(figure).to_have_count(0)
