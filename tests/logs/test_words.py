"""Words of the trade are explained where they stand, and the text stays what it was."""

import re
from html import unescape

import pytest
from hypothesis import given
from hypothesis import strategies as st

from logs.figures.words import TERMS, explained, glossary_link, meaning, words_of
from messages.text import html

WORDS = st.lists(
    st.sampled_from([*TERMS, "Blind", "unbounded", "valid rate", "<b>", "&", " ", ", ", "NISx"]),
    max_size=12,
).map(" ".join)


def bare(markup):
    return unescape(re.sub(r"<a [^>]*>|</a>", "", str(markup)))


@given(st.one_of(WORDS, st.text(max_size=80)))
def test_a_text_is_the_same_with_its_words_explained_once(text):
    found = str(explained(text))
    links = re.findall(r'href="([^"]+)"', found)
    assert sorted(links) == sorted(map(glossary_link, words_of([text])))
    assert bare(found) == unescape(str(html(text)))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("blind: too slow to be seen", ["blind"]),
        ("3σ bound", ["bound"]),
        ("NIS, products filter; NIS again", ["NIS"]),
        ("products, moving horizon", ["horizon"]),
        ("not a valid file", []),
        ("valid, ambiguous or blind", ["valid", "ambiguous", "blind"]),
        ("unbound boundary", []),
    ],
)
def test_what_counts_as_a_word(text, words):
    assert re.findall(r">([^<]+)</a>", str(explained(text))) == words
    assert list(words_of([text])) == words


def test_every_meaning_is_a_sentence_and_titles_have_theirs():
    assert all(text[0].isupper() and text.endswith(".") for text in TERMS.values())
    assert meaning("Horizon") == TERMS["horizon"] and meaning("Rates") == ""
