"""Texts of the bus, of people and of files that want to be more than text: every panel, every page
and a real browser show them as text.
"""

import contextlib
import html.parser
import itertools
from types import SimpleNamespace

import pytest
import viser
from support.browser import KNOWN, Rounds, visit
from support.feeder import Feeder
from support.front_door import open_door
from support.hostile import HOSTILE

from dashboard.data.store import Store
from dashboard.desk import Desk
from dashboard.scene.panels import PAGES
from dashboard.scene.service import start
from dashboard.scene.view import View
from dashboard.web.frame.scene_page import policy, script_hashes
from logs.figures.words import TERMS, glossary_link
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp
from sessions.library.annotations import Annotations, SessionNote
from sessions.recording.manifest import Manifest, write_manifest
from tests.dashboard.test_health import health
from tests.dashboard.test_scene import Direct

OURS = set(
    "p b i em small sub span div table tr td svg g defs clippath polyline polygon path text rect"
    " line circle ellipse style ul li title".split()
)
ATTRIBUTES = set(
    "class style colspan viewbox width height role aria-label points fill stroke stroke-width"
    " stroke-linecap stroke-linejoin font-size font-weight text-anchor x y x1 x2 y1 y2 cx cy r rx"
    " ry d id transform clip-path fill-opacity title data-state data-chart"
    " xmlns font-family stroke-opacity stroke-dasharray".split()
)
GLOSSARY = {glossary_link(word) for word in TERMS}


class Reader(html.parser.HTMLParser):
    """What a browser would make of the HTML of a panel."""

    def __init__(self):
        super().__init__()
        self.strange, self.text = [], ""

    def handle_starttag(self, tag, attrs):
        if tag == "a" and dict(attrs).get("href") in GLOSSARY:
            return
        if tag not in OURS or any(name not in ATTRIBUTES for name, _ in attrs):
            self.strange.append((tag, attrs))

    def handle_data(self, data):
        self.text += data

    def handle_comment(self, data):
        self.strange.append(("comment", data))

    handle_decl = handle_pi = unknown_decl = handle_comment


def spoil(message, word: str) -> None:
    """This word in every text of a message, one more entry in every list and map of texts."""
    for field in message.DESCRIPTOR.fields:
        text = field.type == field.TYPE_STRING
        value = getattr(message, field.name)
        entry = field.message_type and field.message_type.GetOptions().map_entry
        if entry:
            if field.message_type.fields_by_name["key"].type == field.TYPE_STRING:
                if field.message_type.fields_by_name["value"].type == field.TYPE_STRING:
                    value[word] = word
                elif field.message_type.fields_by_name["value"].message_type is None:
                    value[word] = 1
        elif field.message_type and field.is_repeated:
            if not value:
                value.add()
            for one in value:
                spoil(one, word)
        elif field.message_type:
            if message.HasField(field.name):
                spoil(value, word)
        elif text and field.is_repeated:
            value[:] = [word] * max(1, len(value))
        elif text:
            setattr(message, field.name, word)


class Spoiling(Direct):
    """Messages with a hostile word in all their texts, of estimators with hostile names."""

    def __init__(self, store: Store, word: str, names: bool = True) -> None:
        super().__init__(store)
        self._word, self._names = word, names

    def put(self, topic, device, message, estimator="") -> None:
        spoil(message, self._word)
        if estimator and self._names:
            estimator = f"{estimator[:3]}{self._word}"
        super().put(topic, device, message, estimator)


def fill(store: Store, word: str, names: bool = True) -> None:
    """A cube, a car and a board that say this word wherever they can."""
    spoiling = Spoiling(store, word, names)
    feeder = Feeder(spoiling)
    for k in range(300):
        feeder.cube(k * 0.01)
        if k % 2 == 0:
            feeder.drive(k * 0.01)
    feeder.recorder(3.0)
    head = pb.Header(utc_ns=1_750_000_003_000_000_000)
    for device in ("cube-01", "car-01"):
        axes = health()
        axes.header.utc_ns = head.utc_ns
        others = [
            (tp.AXES, axes),
            (tp.LINK, pb.LinkStatus(header=head, damage={"crc": 3})),
            (tp.BOARD, pb.BoardInfo(header=head, faults=[pb.Fault(active=True)])),
            (tp.CALIBRATION, pb.CalibrationStatus(header=head, state=2)),
            (tp.WIRING, pb.WiringStatus(header=head, state=2, inputs=[pb.WiringStatus.Input()])),
            (tp.NOTE, pb.Note(header=head)),
            (tp.LOG, tp.LOG.type()),
        ]
        for topic, message in others:
            spoiling.put(topic, device, message)
        status = pb.EstimatorStatus(header=head, state="x: y")
        spoiling.put(tp.ESTIMATOR, device, status, "kf")
    replay = pb.ReplayStatus(header=head, length_s=5.0, speed=1.0)
    spoiling.put(tp.REPLAY, "replay", replay)


@pytest.fixture
def server():
    running = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield running
    running.stop()


class Gui:
    """A browser's interface that remembers the HTML elements in it."""

    def __init__(self, gui) -> None:
        self._gui, self.handles = gui, []

    def __getattr__(self, name):
        return getattr(self._gui, name)

    def add_html(self, *given, **more):
        self.handles.append(self._gui.add_html(*given, **more))
        return self.handles[-1]


@pytest.mark.parametrize("word", HOSTILE, ids=range(len(HOSTILE)))
def test_every_panel_shows_text_as_text(server, word):
    store = Store()
    fill(store, word)
    gui = Gui(server.gui)
    client = SimpleNamespace(
        gui=gui,
        scene=server.scene,
        camera=SimpleNamespace(fov=1.0, aspect=1.0),
        atomic=contextlib.nullcontext,
    )
    view = View(client, store, Desk(None, "gyrofree"))
    shown = 0
    for device, page in itertools.product(("cube-01", "car-01"), range(len(PAGES))):
        view._choose(device, by_person=True)
        view._choose_page(page)
        view.tick_panels()
        for handle in gui.handles:
            reader = Reader()
            reader.feed(handle.content)
            reader.close()
            assert not reader.strange, (PAGES[page].__name__, reader.strange)
            acting = [c for c in reader.text if c < " " and c != "\n" or c in "\u202e\u2066\u200b"]
            assert not acting, (PAGES[page].__name__, acting)
            shown += word[:12] in reader.text
    assert shown > 20 or not word[:12].isprintable()


def test_a_text_that_is_no_markup_is_shown_as_it_stands(server):
    client = SimpleNamespace(gui=server.gui)
    panel = PAGES[0](client, server.gui.add_folder(None))
    assert panel.html("<b>x</b>", None).content == "&lt;b&gt;x&lt;/b&gt;"


def test_the_scene_page_lets_no_other_script_run():
    assert len(script_hashes()) == 3
    scripts = next(p for p in policy("x").split(";") if p.strip().startswith("script-src"))
    assert "unsafe-inline" not in scripts and "'unsafe-eval'" not in scripts


# --- in a real browser


ATTACK = """() => {
  const add = (html) => document.body.insertAdjacentHTML('beforeend', html);
  add('<img src="data:x" onerror="window.hit=1">');
  add('<svg onload="window.hit=2"></svg>');
  add('<iframe srcdoc="<script>parent.hit=3</script>"></iframe>');
  const one = document.createElement('script');
  one.textContent = 'window.hit=4';
  document.body.append(one);
  const link = document.createElement('a');
  link.href = 'javascript:window.hit=5';
  document.body.append(link);
  link.click();
}"""


@pytest.mark.browser
@pytest.mark.timeout(300)
def test_a_browser_runs_nothing_that_came_over_the_bus(chromium, tmp_path):
    store = Store()
    for word in HOSTILE:
        fill(store, word)
    desk = Desk(None, "gyrofree")
    stack = contextlib.ExitStack()
    rounds = stack.enter_context(Rounds.counted())
    handle = start(SimpleNamespace(viser_port=0), store, desk)
    stack.callback(handle.stop)
    with stack:
        with open_door(tmp_path, scene=False, scene_at=handle.port, store=store) as door:
            with visit(chromium, door, "anna") as (page, said):
                page.goto(f"{door.url}/scene/")
                page.wait_for_selector(".gf-name", timeout=90_000)
                for key in [one.key() for one in PAGES]:
                    page.locator("div:has(> .gf-state) + div input").fill(f"p={key}")
                    page.wait_for_function(STATED, arg=key)
                    rounds.after(page)
                assert "<script>" in page.inner_text("body")
                assert page.evaluate("() => window.hit") is None
                assert not [line for line in said if not any(k in line for k in KNOWN)], said
                page.evaluate(ATTACK)
                page.wait_for_timeout(1000)
                assert page.evaluate("() => window.hit") is None
                refused = [line for line in said if "inline" in line]
                assert len(refused) >= 4, said


STATED = "(key) => JSON.parse(document.querySelector('.gf-state').dataset.state).page === key"


def hostile_sessions(root) -> list[str]:
    """Recordings whose texts are hostile, as files that somebody brought along may have them."""
    names = []
    for k, word in enumerate(HOSTILE):
        folder = root / f"20260101-0000{k:02d}-x"
        folder.mkdir(parents=True)
        manifest = Manifest(
            id=folder.name,
            state="closed",
            note=word,
            user=word,
            devices=[word],
            sources=[word],
            recovery=word,
            provenance={word: {word: word}},
        )
        write_manifest(folder, manifest)
        (folder / "recording.mcap").write_bytes(b"")
        said = Annotations.model_construct(
            title=word[:200],
            tags=[word],
            outcome="pass",
            notes=[SessionNote(text=word[:2000], author=word, at_s=1.0)],
        )
        (folder / "annotations.json").write_text(said.model_dump_json())
        names.append(folder.name)
    return names


@pytest.mark.browser
@pytest.mark.timeout(300)
def test_pages_of_hostile_recordings_run_nothing(chromium, tmp_path):
    names = hostile_sessions(tmp_path / "sessions")
    with open_door(tmp_path, scene=False) as door, visit(chromium, door, "anna") as (page, said):
        for path in ["sessions", "users", "trend", *(f"sessions/{name}" for name in names)]:
            page.goto(f"{door.url}/{path}")
            page.wait_for_timeout(150)
            assert page.evaluate("() => window.hit") is None, path
            shown = page.inner_text("body")
            assert not {"\u202e", "\u2066", "\x1b", "\u200b"} & set(shown), path
        page.goto(f"{door.url}/sessions")
        assert "<script>window.hit=1</script>" in page.inner_text("body")
        page.evaluate(ATTACK)
        page.wait_for_timeout(500)
        assert page.evaluate("() => window.hit") is None
