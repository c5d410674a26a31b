"""Copies of recordings: equal at the end whatever grows, changes, breaks off or lies between."""

import hashlib
import json
import random
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
import zenoh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.stack import free_port

from messages.bus.session import BusSettings, open_client, open_router
from sessions.library.copied import read_copied
from sites.copying.fetching import BOOK, Copies, load_copies
from sites.copying.gathering import AT_ONCE, Drafts, Gathering, Segment
from sites.copying.serving import Answers
from sites.copying.shelf import PART, SEGMENT, Shelf, ShelfError, hash_file, list_file
from sites.copying.since import Heard, Told
from sites.place import SiteError
from sites.roles import segment_key
from sites.service import copy

PARTS = SEGMENT // PART  # of a full segment
ONE, TWO = "20261129-120000-first", "20261129-130000"


class Home:
    """Home's answers, from real files, over a link that may fail or lie."""

    def __init__(self, root: Path) -> None:
        self.answers = Answers(root)
        self.bytes = 0
        self.asked: list[str] = []
        self.given: list[str] = []
        self.fails_after: int | None = None
        self.lies = False

    def __call__(self, what: str) -> bytes:
        self.asked.append(what)
        if self.fails_after is not None and len(self.asked) > self.fails_after:
            raise SiteError("the site's home does not answer")
        self.given.append(what)
        answer = self.answers(what.split("/"))
        self.bytes += len(answer)
        return bytes(len(answer)) if self.lies and "-" in what.split("/")[-2] else answer


def record(root: Path, session: str, content: bytes, state: str = "closed") -> None:
    folder = root / session
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "recording.mcap").write_bytes(content)
    (folder / "session.json").write_text(json.dumps({"id": session, "state": state}))


def same(home: Path, here: Path, session: str) -> bool:
    return all(
        (here / session / name).read_bytes() == (home / session / name).read_bytes()
        for name in ("recording.mcap", "session.json")
    )


def noise(size: int, seed: int = 1) -> bytes:
    return random.Random(seed).randbytes(size)


@pytest.fixture
def roots(tmp_path: Path) -> tuple[Path, Path, Path]:
    """Sessions of home, those here, and the folder of this place."""
    made = tmp_path / "home", tmp_path / "here", tmp_path / "place"
    for each in made:
        each.mkdir()
    return made


def go(copies: Copies, home: Home) -> int:
    return copies.round(lambda: [home], lambda: False)


def test_newest_first_equal_and_proven_and_asked_for_once(roots: tuple[Path, Path, Path]) -> None:
    there, here, place = roots
    record(there, ONE, noise(3 * SEGMENT + 5))
    record(there, TWO, noise(10, 2))
    home = Home(there)
    assert go(Copies(here, place), home) == 2
    assert same(there, here, ONE) and same(there, here, TWO)
    first = next(each for each in home.asked if not each.startswith("index"))
    assert first.startswith(TWO)
    known = load_copies(place)[ONE]["files"]["recording.mcap"]
    content = (there / ONE / "recording.mcap").read_bytes()
    assert known["home_sha256"] == known["here_sha256"] == hashlib.sha256(content).hexdigest()
    copied = read_copied(here / ONE)
    assert copied.files["recording.mcap"].equal and set(copied.files) == set(
        load_copies(place)[ONE]["files"]
    )
    home.asked.clear()
    assert go(Copies(here, place), home) == 0
    assert [each.split("/")[0] for each in home.asked] == ["index"]


def test_a_recording_that_runs_is_copied_by_full_segments_until_it_ends(
    roots: tuple[Path, Path, Path],
) -> None:
    there, here, place = roots
    content, home, copies = noise(4 * SEGMENT), Home(there), Copies(here, place)
    for size in (10, SEGMENT + 10, SEGMENT + 99, 3 * SEGMENT + 1):
        record(there, ONE, content[:size], "open")
        assert go(copies, home) == 0
        assert not (here / ONE / "session.json").exists()
    fetched = [each for each in home.asked if "/recording.mcap/" in each]
    assert len(fetched) == len(set(fetched)) == 3 * PARTS
    record(there, ONE, content)
    assert go(copies, home) == 1
    assert same(there, here, ONE)


@pytest.mark.parametrize(("lives", "answers"), [(1, 4), (40, 20)])
def test_a_link_that_breaks_anywhere_costs_nothing_twice(
    roots: tuple[Path, Path, Path], lives: int, answers: int
) -> None:
    """The process that copies lives on, or begins anew each time with what is on the disk."""
    there, here, place = roots
    record(there, ONE, noise(6 * SEGMENT + 7))
    home, copies = Home(there), Copies(here, place)
    for _ in range(40):
        copies = copies if lives == 1 else Copies(here, place)
        home.fails_after = len(home.asked) + answers
        try:
            if go(copies, home):
                break
        except SiteError:
            continue
    assert same(there, here, ONE)
    fetched = [each for each in home.given if "/recording.mcap/" in each]
    assert len(set(fetched)) == 6 * PARTS + 1
    again = [each for each in fetched if fetched.count(each) > 1]
    assert not again if lives == 1 else len(again) <= answers * len(fetched) // PARTS


def test_bytes_that_are_not_home_s_never_take_their_place(roots: tuple[Path, Path, Path]) -> None:
    there, here, place = roots
    record(there, ONE, noise(2 * SEGMENT))
    home = Home(there)
    home.lies = True
    assert go(Copies(here, place), home) == 0
    assert not (here / ONE / "recording.mcap").exists() and not load_copies(place)
    home.lies = False
    assert go(Copies(here, place), home) == 1 and same(there, here, ONE)


def test_what_was_spoilt_on_the_disk_here_is_mended(roots: tuple[Path, Path, Path]) -> None:
    there, here, place = roots
    record(there, ONE, noise(3 * SEGMENT))
    home = Home(there)
    go(Copies(here, place), home)
    spoilt = bytearray((here / ONE / "recording.mcap").read_bytes())
    spoilt[SEGMENT + 3] ^= 1
    (here / ONE / "recording.mcap").write_bytes(spoilt)
    (place / BOOK).write_text("{ not json")
    home.asked.clear()
    assert go(Copies(here, place), home) == 1
    assert same(there, here, ONE)
    assert len([each for each in home.asked if "/recording.mcap/" in each]) == PARTS


@given(sizes=st.lists(st.integers(0, 3 * SEGMENT), min_size=1, max_size=5))
@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_hashes_of_a_growing_file_are_those_of_the_whole(tmp_path: Path, sizes: list[int]) -> None:
    content, path, before = noise(3 * SEGMENT), tmp_path / "recording.mcap", None
    for size in sorted(sizes):
        path.write_bytes(content[:size])
        before = hash_file(path, before)
        assert before.listed == list_file(path)
        assert before.listed.sha256 == hashlib.sha256(content[:size]).hexdigest()


@pytest.mark.parametrize(
    ("session", "name", "first"),
    [
        ("../../etc", "passwd", 0),
        (ONE, "../session.json", 0),
        (ONE, "recording.mcap", 7),
        (ONE, "link.mcap", 0),
        ("20990101-000000", "recording.mcap", 0),
    ],
)
def test_nothing_beside_the_sessions_can_be_asked_for(
    roots: tuple[Path, Path, Path], session: str, name: str, first: int
) -> None:
    there = roots[0]
    record(there, ONE, b"x")
    (there / ONE / "link.mcap").symlink_to("/etc/passwd")
    with pytest.raises(ShelfError):
        Shelf(there).segment(session, name, first)


@pytest.mark.parametrize(
    "answer",
    [
        b"",
        b"[]",
        b"\xff\x00",
        b'{"files": {"../../x": {"size": 0, "sha256": "%s", "segments": []}}}' % (b"0" * 64),
        b'{"files": {"a.mcap": {"size": 9, "sha256": "%s", "segments": []}}}' % (b"0" * 64),
        b'{"files": {"a.mcap": {"size": -9, "sha256": "x", "segments": []}}}',
    ],
)
def test_a_list_that_cannot_be_is_refused(roots: tuple[Path, Path, Path], answer: bytes) -> None:
    _, here, place = roots

    def ask(what: str) -> bytes:
        return Told().since("", f"{ONE} x".encode()) if what.startswith("index") else answer

    with pytest.raises(SiteError, match="list of segments"):
        Copies(here, place).round(lambda: [ask], lambda: False)
    assert not list(here.iterdir())


# --- several ways, some of them bad


def segments_of(content: bytes) -> list[Segment]:
    return [
        Segment(
            at, hashlib.sha256(content[at : at + SEGMENT]).hexdigest(), len(content[at:][:SEGMENT])
        )
        for at in range(0, len(content), SEGMENT)
    ]


class Way:
    """Answers with the parts of one content; `before` is called first."""

    def __init__(self, content: bytes, before: Callable[[], object]) -> None:
        self.content, self.before, self.asked = content, before, []

    def __call__(self, what: str) -> bytes:
        self.asked.append(what)
        self.before()
        first, offset = int(what.split("/")[-2].partition("-")[0]), int(what.split("/")[-1])
        return self.content[first + offset : first + SEGMENT][:PART]


def gathered(content: bytes, ways: list[Way]) -> bytes:
    """What comes of it, one segment behind the other; each has to come once."""
    made: dict[int, bytes] = {}

    def keep(segment: Segment, piece: bytes) -> bool:
        assert segment.first not in made
        made[segment.first] = piece
        return True

    gathering = Gathering("s/f", iter(segments_of(content)), Drafts(), keep)
    assert gathering.run(lambda: ways, lambda: False)
    return b"".join(made[first] for first in sorted(made))


def test_a_way_that_never_answers_holds_up_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sites.copying.gathering.LATE_S", 0.05)
    content, began, released = noise(2 * SEGMENT + 9), threading.Event(), threading.Event()

    def for_ever() -> None:
        began.set()
        released.wait(60.0)

    stuck, good = Way(content, for_ever), Way(content, lambda: began.wait(60.0))
    assert gathered(content, [stuck, good]) == content
    assert 1 <= len(stuck.asked) <= AT_ONCE and set(stuck.asked) <= set(good.asked)
    released.set()


def test_a_way_that_failed_comes_back_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sites.copying.gathering.BACK_S", 0.0)
    content, back = noise(2 * SEGMENT), threading.Event()

    def fail_twice() -> None:
        if len(broken.asked) <= AT_ONCE:
            raise SiteError("this way is gone")
        back.set()

    broken = Way(content, fail_twice)
    good = Way(content, lambda: back.wait(30.0))
    assert gathered(content, [broken, good]) == content
    assert len(broken.asked) > AT_ONCE


def test_the_last_way_that_fails_ends_it() -> None:
    def fail() -> None:
        raise SiteError("this way is gone")

    gone = Way(noise(SEGMENT), fail)
    with pytest.raises(SiteError, match="gone"):
        gathered(gone.content, [gone])


def test_who_waits_for_home_ends_when_he_is_told_to(
    roots: tuple[Path, Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The link is cut: home has the question, and its answer does not come."""
    monkeypatch.setattr("sites.service.INDEX_S", 600.0)
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    bus = BusSettings(prefix="lab", router=endpoint, listen=[endpoint])
    _, here, place = roots
    waiting, came, stop = [], threading.Event(), threading.Event()

    def on_query(query: zenoh.Query) -> None:
        waiting.append(query)  # answered by nobody
        came.set()

    with open_router(bus), open_client(bus) as home, open_client(bus) as office:
        queryable = home.declare_queryable(f"{segment_key('lab')}/**", on_query)
        arguments = (Copies(here, place), "lab", office, stop)
        thread = threading.Thread(target=copy, args=arguments, daemon=True)
        thread.start()
        assert came.wait(30.0)
        stop.set()
        thread.join(60.0)
        assert not thread.is_alive()
        queryable.undeclare()
        waiting.clear()


# --- what has changed


@given(answers=st.lists(st.binary(max_size=40), max_size=6), lost=st.integers(0, 5))
@settings(max_examples=50)
def test_what_is_told_by_changes_is_the_answer(answers: list[bytes], lost: int) -> None:
    told, heard = Told(), Heard()
    for number, answer in enumerate(answers):
        told = Told() if number == lost else told  # home began anew
        says = partial(lambda told, answer, what: told.since(what[-64:], answer), told, answer)
        assert heard.asked("index", says) == answer


def test_a_long_list_that_grows_is_told_by_its_end(roots: tuple[Path, Path, Path]) -> None:
    there, here, place = roots
    for minute in range(60):
        record(there, f"20261129-10{minute:02}00", b"x")
    home, copies = Home(there), Copies(here, place)
    go(copies, home)
    whole, home.bytes = len(home.answers(["index"])), 0
    go(copies, home)
    assert home.bytes < 100 < whole
    record(there, "20261129-110000", b"x", "open")
    home.bytes = 0
    go(copies, home)
    assert home.bytes < 800 < whole
