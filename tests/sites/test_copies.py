"""Copies of recordings: equal at the end whatever grows, changes, breaks off or lies between."""

import hashlib
import json
import random
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sites.copying.fetching import BOOK, Copies, load_copies
from sites.copying.shelf import SEGMENT, Shelf, ShelfError, hash_file, list_file
from sites.place import SiteError

ONE, TWO = "20261129-120000-first", "20261129-130000"


class Home:
    """Home's answers, from real files, over a link that may fail or lie."""

    def __init__(self, root: Path) -> None:
        self.shelf = Shelf(root)
        self.asked: list[str] = []
        self.given: list[str] = []
        self.fails_after: int | None = None
        self.lies = False

    def __call__(self, what: str) -> bytes:
        self.asked.append(what)
        if self.fails_after is not None and len(self.asked) > self.fails_after:
            raise SiteError("the site's home does not answer")
        self.given.append(what)
        if what == "index":
            return "\n".join(f"{n} {s}" for n, s in self.shelf.stamps().items()).encode()
        parts = what.split("/")
        if len(parts) == 1:
            return self.shelf.listing(what).model_dump_json().encode()
        piece = self.shelf.segment(parts[0], parts[1], int(parts[2].partition("-")[0]))
        return bytes(len(piece)) if self.lies else piece


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
    return copies.round([home], lambda: False)


def test_newest_first_equal_and_proven_and_asked_for_once(roots: tuple[Path, Path, Path]) -> None:
    there, here, place = roots
    record(there, ONE, noise(3 * SEGMENT + 5))
    record(there, TWO, noise(10, 2))
    home = Home(there)
    assert go(Copies(here, place), home) == 2
    assert same(there, here, ONE) and same(there, here, TWO)
    first = next(each for each in home.asked if "/" in each)
    assert first.startswith(TWO)
    known = load_copies(place)[ONE]["files"]["recording.mcap"]
    content = (there / ONE / "recording.mcap").read_bytes()
    assert known["home_sha256"] == known["here_sha256"] == hashlib.sha256(content).hexdigest()
    home.asked.clear()
    assert go(Copies(here, place), home) == 0
    assert home.asked == ["index"]


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
    assert len(fetched) == len(set(fetched)) == 3
    record(there, ONE, content)
    assert go(copies, home) == 1
    assert same(there, here, ONE)


def test_a_link_that_breaks_anywhere_costs_no_segment_twice(
    roots: tuple[Path, Path, Path],
) -> None:
    there, here, place = roots
    record(there, ONE, noise(6 * SEGMENT + 7))
    home = Home(there)
    for _ in range(40):
        home.fails_after = len(home.asked) + 4
        try:
            if go(Copies(here, place), home):
                break
        except SiteError:
            continue
    assert same(there, here, ONE)
    fetched = [each for each in home.given if "/recording.mcap/" in each]
    assert len(fetched) == len(set(fetched)) == 7


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
    assert len([each for each in home.asked if "/recording.mcap/" in each]) == 1


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
        return f"{ONE} x".encode() if what == "index" else answer

    with pytest.raises(SiteError, match="list of segments"):
        Copies(here, place).round([ask], lambda: False)
    assert not list(here.iterdir())
