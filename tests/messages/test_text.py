"""Text from outside in each medium: what acts or hides is refused at the doors and shown for what
it is elsewhere.
"""

import csv
import html
import html.parser
import io
import unicodedata

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from support.hostile import HOSTILE

from messages import text

ANY = st.text(st.characters(codec=None, categories=None), max_size=60) | st.sampled_from(HOSTILE)


def invisible(shown: str) -> list[str]:
    return [c for c in shown if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp")]


class Parser(html.parser.HTMLParser):
    def __init__(self):
        super().__init__()
        self.tags, self.data = [], ""

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.data += data


@given(ANY)
@example("\u202e" * 10_000)
def test_what_is_shown_is_one_visible_line(given_text):
    shown = text.plain(given_text)
    assert not invisible(shown)
    assert len(shown) <= text.LONGEST * 9
    assert text.plain(shown, 1 << 20) == shown


@given(ANY)
def test_text_inside_html_is_text(given_text):
    parser = Parser()
    parser.feed(f'<p title="{text.html(given_text)}">{text.html(given_text)}</p>')
    parser.close()
    assert parser.tags == [("p", {"title": text.plain(given_text)})]
    assert parser.data == text.plain(given_text)


@given(ANY)
def test_html_is_escaped_once(given_text):
    once = text.html(given_text)
    assert text.html(once) == once


@given(ANY, st.booleans())
def test_what_is_taken_needs_no_change_to_be_shown(given_text, lines):
    fault = text.check(given_text, lines)
    if not fault:
        rest = given_text.replace("\n", "").replace("\t", "") if lines else given_text
        rest = rest.replace("\u200c", "").replace("\u200d", "")
        assert text.plain(rest, 1 << 20) == rest


@given(st.lists(ANY | st.floats(allow_nan=False) | st.integers(), min_size=1, max_size=5))
def test_no_cell_begins_a_formula_and_numbers_are_unchanged(values):
    out = io.StringIO()
    csv.writer(out).writerow([text.cell(value) for value in values])
    [read] = csv.reader(io.StringIO(out.getvalue()))
    for value, got in zip(values, read, strict=True):
        try:
            float(got)
        except ValueError:
            assert got.strip()[:1] not in ("=", "+", "-", "@") and got[:1] not in ("\t", "\r", "\n")
        if not isinstance(value, str):
            assert got == str(value)


@pytest.mark.parametrize(
    "good", ["Messung Prüfstand", "base (1)", "100 % #7", "Tiếng Việt", "测试"]
)
def test_ordinary_words_are_taken(good):
    for form in ("NFC", "NFD"):
        assert text.check(unicodedata.normalize(form, good)) == ""
        assert text.file_name(unicodedata.normalize(form, good) + ".csv") == ""


def test_joined_emoji_and_persian_are_taken_but_no_joiner_between_letters_of_a_name():
    assert text.check("👩\u200d🔬") == "" and text.check("می\u200cخواهم") == ""
    assert "ZERO WIDTH" in text.check("ad\u200dmin").upper()


@pytest.mark.parametrize(
    "bad", ["a\u202eb", "a\0b", "a\x1b[2J", "a\ud800", "e" + "\u0301" * 9, "\ufeff"]
)
def test_what_acts_is_refused_with_a_sentence(bad):
    assert text.check(bad).startswith("character ")


@pytest.mark.parametrize(
    "bad",
    [
        "",
        ".",
        "..",
        "../x.csv",
        "a/b.csv",
        "a\\b",
        "a\0.csv",
        "-x.csv",
        ".hidden",
        "x.csv ",
        "n" * 81,
        "ü" * 79 + "\u0308" * 60,
    ],
)
def test_a_path_is_no_file_name(bad):
    assert text.file_name(bad)


@pytest.mark.parametrize(
    ("value", "wanted"),
    [
        ("=1+1", "'=1+1"),
        ("-5", "-5"),
        ("+3.2e4", "+3.2e4"),
        ("@SUM(A1)", "'@SUM(A1)"),
        (" =cmd", "' =cmd"),
        ("\t=x", "'\t=x"),
        ("plain", "plain"),
        ("", ""),
        (-3.5, -3.5),
        ("-cmd|' /C calc'!A0", "'-cmd|' /C calc'!A0"),
        ("\uff1d1", "'\uff1d1"),
    ],
)
def test_cells(value, wanted):
    assert text.cell(value) == wanted


@pytest.mark.parametrize("mark", ["=", "+", "-", "@", "\uff1d"])
@pytest.mark.parametrize("before", ["a;", "a; ", 'a;"', "a\t", "a\n"])
def test_a_formula_behind_another_spreadsheets_separator_is_text(before, mark):
    assert text.cell(f"{before}{mark}cmd()") == f"{before}'{mark}cmd()"
    assert text.cell("a; b - c = d") == "a; b - c = d"
