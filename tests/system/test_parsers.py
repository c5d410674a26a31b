"""Whatever stands in a file that is kept, its reader gives a result or says what is wrong in its
own kind of error, and never another.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import broken_files

from dashboard.alarms import state_file
from dashboard.web.programs.tokens import load_tokens, tokens_file
from dashboard.web.users import UsersError, add_user, load_users
from gyrofree.config import ConfigError, load
from inertial.calibration.card import CardError, read_card
from inertial.layouts import catalogue
from inertial.layouts.layout import GeometryError
from sessions.library.annotations import read_annotations
from sessions.procedure.driven.description import TableError, described
from sessions.procedure.library import ProcedureError
from sessions.procedure.profile_file import profile_of
from sessions.recording.manifest import MANIFEST, SessionError, read_manifest
from sites.authority import REGISTER, Issued
from sites.copying.fetching import load_copies
from sites.invitation import BOOK, load_book, read_invitation
from sites.joining import make_site
from sites.place import PLACE, SiteError, load_list, load_place

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = 15  # of each reader
EDITS = 6  # of one file


@dataclass(frozen=True)
class Reader:
    """What reads a file of this name in a folder, and how it says that it cannot."""

    name: str
    read: Callable[[Path], object]
    errors: tuple[type[Exception], ...] = ()


READERS = {
    "configuration": Reader("gyrofree.toml", load, (ConfigError,)),
    "layout": Reader("layout.toml", catalogue.load, (GeometryError,)),
    "calibration": Reader("card.toml", read_card, (CardError,)),
    "session": Reader(MANIFEST, lambda path: read_manifest(path.parent), (SessionError,)),
    "annotations": Reader(
        "annotations.json", lambda path: read_annotations(path.parent), (SessionError,)
    ),
    "users": Reader("users.json", load_users, (UsersError,)),
    "alarms": Reader("alarms.json", state_file.load),
    "place": Reader(PLACE, lambda path: load_place(path.parent), (SiteError,)),
    "register": Reader(REGISTER, lambda path: load_list(path, Issued, "restore it"), (SiteError,)),
    "book": Reader(BOOK, lambda path: load_book(path.parents[1]), (SiteError,)),
    "copies": Reader("copies.json", lambda path: load_copies(path.parent), (SiteError,)),
    "invitation": Reader(
        "invitation.txt",
        lambda path: read_invitation(path.read_text(errors="replace")),
        (SiteError,),
    ),
    "profile": Reader("profile.toml", lambda path: profile_of(str(path)), (ValueError,)),
    "table": Reader("table.toml", described, (TableError, ProcedureError)),
    "tokens": Reader(
        tokens_file(Path("users.json")).name,
        lambda path: load_tokens(path.with_name("users.json")),
        (UsersError,),
    ),
}


@pytest.fixture(scope="module")
def seeds(tmp_path_factory) -> dict[str, bytes]:
    """A good content of each, where one is at hand; what has none begins with nothing."""
    folder = tmp_path_factory.mktemp("seeds")
    made = broken_files.good(folder / "good")
    make_site(folder / "site", "lab")
    add_user(folder / "users.json", "anna", "a good long password", "operator")
    table = next((ROOT / "sessions" / "procedure").rglob("simulated.toml"))
    (session,) = (ROOT / "tests" / "sessions" / "data").glob(f"*table/{MANIFEST}")
    return {
        "configuration": (ROOT / "gyrofree.toml").read_bytes(),
        "layout": Path(made["layout.toml"]).read_bytes(),
        "calibration": Path(made["card.toml"]).read_bytes(),
        "session": session.read_bytes(),
        "users": (folder / "users.json").read_bytes(),
        "place": (folder / "site" / PLACE).read_bytes(),
        "register": (folder / "site" / REGISTER).read_bytes(),
        "table": table.read_bytes(),
        "profile": b"[[step]]\nrate = 10\nseconds = 3\n",
        "annotations": json.dumps({"title": "x", "notes": [{"text": "y"}]}).encode(),
    }


@st.composite
def spoilt(draw, good: bytes) -> bytes:
    """The good bytes with some edits, or any bytes at all."""
    if draw(st.integers(0, 9)) == 0:
        return draw(st.binary(max_size=200))
    data = bytearray(good)
    for _ in range(draw(st.integers(1, EDITS))):
        at = draw(st.integers(0, len(data)))
        piece = draw(
            st.one_of(
                st.binary(max_size=3),
                st.sampled_from([b"null", b"[]", b"{}", b"-1", b"1e999", b"nan", b'""', b"\x00"]),
            )
        )
        data[at : at + draw(st.integers(0, 8))] = piece
    return bytes(data)


@pytest.mark.parametrize("kind", READERS)
def test_a_reader_gives_a_result_or_says_what_is_wrong(kind, seeds, tmp_path):
    reader = READERS[kind]

    @settings(max_examples=EXAMPLES, deadline=None, derandomize=True)
    @given(spoilt(seeds.get(kind, b"{}")))
    def look(content: bytes) -> None:
        path = tmp_path / reader.name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(content)
        try:
            reader.read(path)
        except reader.errors as error:
            assert str(error)

    look()
