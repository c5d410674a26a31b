"""What the documents name exists: files, and things in them."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
GUIDES = ("README.md", "CONTRIBUTING.md", "docs/glossary.md")
TOPS = tuple(
    path.name for path in ROOT.iterdir() if path.is_dir() and not path.name.startswith(".")
)
NAMED = re.compile(r"`([\w./-]+)`")
LINK = re.compile(r"\]\(([^)#]+)[^)]*\)")
THING = re.compile(r"`(\w+)` in `([\w./-]+\.\w+)`")


def text_of(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


@pytest.mark.parametrize("name", GUIDES)
def test_every_file_that_a_guide_names_is_there(name):
    named = {
        found for found in NAMED.findall(text_of(name)) if found.startswith(TOPS) and "/" in found
    }
    made = {"docs/"} | {found for found in named if found.startswith(("build/", "var/"))}
    missing = sorted(found for found in named - made if not (ROOT / found).exists())
    assert named and not missing


@pytest.mark.parametrize(
    "page",
    [
        "README.md",
        "CONTRIBUTING.md",
        "CHANGELOG.md",
        *(f"docs/{p.name}" for p in (ROOT / "docs").glob("*.md")),
    ],
)
def test_every_link_of_a_page_leads_somewhere(page):
    targets = [t for t in LINK.findall(text_of(page)) if "://" not in t]
    missing = [t for t in targets if not ((ROOT / page).parent / t).exists()]
    assert not missing


def test_what_the_glossary_and_the_guide_say_of_a_file_stands_in_it():
    found = [pair for name in GUIDES for pair in THING.findall(text_of(name))]
    assert len(found) > 5
    for thing, path in found:
        assert re.search(rf"\b{thing}\b", text_of(path)), f"{thing} in {path}"


def test_the_guide_names_a_way_for_frame_estimator_and_panel():
    guide = text_of("CONTRIBUTING.md")
    for heading in ("a frame to the wire", "a rate estimator", "a panel"):
        part = guide.split(f"## How to add {heading}")[1].split("\n## ")[0]
        assert len(NAMED.findall(part)) >= 6, heading
