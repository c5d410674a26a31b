"""The site: every page has its place, pictures are current, symptoms are the program's own words.

`make test` builds the site, strictly, before; here it is looked at for what would fetch from
elsewhere.
"""

import re
import runpy
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS, SITE = ROOT / "docs", ROOT / "build" / "site"
NAMED = re.compile(r": ([\w/-]+\.md)$", re.MULTILINE)
SYMPTOM = re.compile(r"^\| `([^`]+)` \|", re.MULTILINE)
FETCHED = re.compile(r"""(?:\bsrc|<link[^>]+href)=["']?(?:https?:)?//""")
GUIDE = sorted((DOCS / "guide").glob("*.md"))


def test_every_page_has_its_place_in_the_site():
    named = NAMED.findall((ROOT / "mkdocs.yml").read_text())
    assert sorted(named) == sorted(str(p.relative_to(DOCS)) for p in DOCS.rglob("*.md"))


def test_drawn_pictures_are_those_that_the_script_draws(tmp_path):
    drawn = runpy.run_path(str(DOCS / "guide" / "draw.py"))["draw"](tmp_path)
    assert len(drawn) == 3
    for path in drawn:
        same = path.read_bytes() == (DOCS / "guide" / "pictures" / path.name).read_bytes()
        assert same, f"{path.name}: run docs/guide/draw.py"  # the files' difference takes minutes


@pytest.mark.parametrize("page", GUIDE, ids=lambda page: page.stem)
def test_every_picture_of_the_guide_is_there_and_says_what_it_shows(page):
    for alt, target in re.findall(r"!\[([^]]*)\]\(([^)]+)\)", page.read_text()):
        assert alt and (page.parent / target).exists(), target


def test_no_picture_is_left_over():
    used = "".join(page.read_text() for page in DOCS.rglob("*.md"))
    assert not [p.name for p in (DOCS / "guide" / "pictures").iterdir() if p.name not in used]


@cache
def source() -> str:
    """All Python of the product, adjacent parts of a text joined."""
    rooms = ("gyrofree", "gateway", "estimator", "inertial", "logs", "sessions", "dashboard")
    rooms += ("messages", "sites")
    text = "\n".join(
        path.read_text(encoding="utf-8")
        for room in rooms
        for path in sorted((ROOT / room).rglob("*.py"))
    )
    return re.sub(r'"\s*\n\s*f?"', "", text)


SYMPTOMS = SYMPTOM.findall((DOCS / "guide" / "troubleshooting.md").read_text())


@pytest.mark.parametrize("symptom", SYMPTOMS)
def test_a_symptom_is_in_the_programs_own_words(symptom):
    assert symptom in source()


def test_there_are_symptoms():
    assert len(SYMPTOMS) > 20


def test_the_built_site_fetches_nothing_from_elsewhere():
    if not SITE.exists():
        pytest.skip("not built: make site")
    pages = sorted(SITE.rglob("*.html"))
    assert len(pages) > 30
    for page in pages:
        assert not FETCHED.search(page.read_text(encoding="utf-8")), page
    for sheet in SITE.rglob("*.css"):
        assert not re.search(r"url\(\s*[\"']?https?:", sheet.read_text(encoding="utf-8")), sheet
