"""What the documents name exists: files, and things in them."""

import re
from pathlib import Path

import pytest
import typer

from gyrofree.commands.main import app

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
        *(str(p.relative_to(ROOT)) for p in (ROOT / "docs").rglob("*.md")),
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


DEFINED = re.compile(r"^(?:\| |\()(E-\d+)(?: \||\))", re.MULTILINE)


def test_an_equation_has_one_number_and_a_number_one_equation():
    """The code cites numbers alone, so that each must lead to one place."""
    places: dict[str, list[str]] = {}
    for page in sorted((ROOT / "docs").glob("equations*.md")):
        for number in DEFINED.findall(page.read_text(encoding="utf-8")):
            places.setdefault(number, []).append(page.name)
    assert len(places) > 100
    assert {n: pages for n, pages in places.items() if len(pages) > 1} == {}


def test_an_equation_that_the_code_cites_is_written_down():
    known = {
        number
        for page in (ROOT / "docs").glob("equations*.md")
        for number in re.findall(r"\bE-\d+\b", page.read_text(encoding="utf-8"))
    }
    sources = [p for kind in ("py", "hpp", "cpp") for p in (ROOT / "inertial").rglob(f"*.{kind}")]
    cited = {
        (number, path.relative_to(ROOT).as_posix())
        for path in sources
        for number in re.findall(r"\bE-\d+\b", path.read_text(encoding="utf-8"))
    }
    assert len(cited) > 100
    assert sorted(c for c in cited if c[0] not in known) == []


COMMAND = re.compile(r"(?:^|`|    |\.venv/bin/)gyrofree ([a-z][^`\n#]*)", re.MULTILINE)


def commands_of(page: str) -> list[list[str]]:
    """What a page tells people to type after `gyrofree`, word by word."""
    return [found.split() for found in COMMAND.findall(text_of(page))]


@pytest.mark.parametrize(
    "page", ["README.md", *(f"docs/{p.name}" for p in (ROOT / "docs").glob("*.md"))]
)
def test_every_command_of_a_page_exists_with_its_options(page):
    for words in commands_of(page):
        command, rest = typer.main.get_command(app), list(words)
        while hasattr(command, "commands") and rest:
            name = rest.pop(0).rstrip(",.:;")
            assert name in command.commands, f"{page}: gyrofree {' '.join(words)}"
            command = command.commands[name]
        known = {option for parameter in command.params for option in parameter.opts}
        asked = {
            word.strip("[],.;").split("=")[0] for word in rest if word.strip("[").startswith("--")
        }
        assert asked <= known | {"--help"}, f"{page}: gyrofree {' '.join(words)}"


def test_the_guide_shows_commands():
    assert sum(len(commands_of(f"docs/{p.name}")) for p in (ROOT / "docs").glob("*.md")) > 30


def test_every_figure_of_the_readme_has_its_command_beside_it():
    table = text_of("README.md").split("## Figures")[1].split("\n## ")[0]
    rows = [line for line in table.splitlines() if line.startswith("| ")][1:]
    assert len(rows) > 20
    for row in rows:
        last = row.strip("| ").split(" | ")[-1]
        assert last == "same" or "`" in last or "](docs/" in last, row
        for name in re.findall(r"`(?:pytest )?(tests/[\w/.]+)", last):
            assert (ROOT / name).exists(), row


@pytest.mark.parametrize(
    "word", ["bad bytes", "clock skew", "fresh", "latency", "tachometer", "blind", "NIS", "bound"]
)
def test_words_of_the_page_are_in_the_glossary(word):
    assert re.search(rf"^\| [^|]*{word}", text_of("docs/glossary.md"), re.MULTILINE)
    said = "".join(p.read_text() for p in (ROOT / "dashboard/scene").rglob("*.py"))
    assert word.split()[0] in said, "no longer on the page"
