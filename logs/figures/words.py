"""Words of the trade that stand on pages and in reports, and what they mean: each is explained
where it stands. docs/glossary.md has more.
"""

import re
from collections.abc import Callable

from markupsafe import Markup

from messages.text import html

TERMS = {
    "valid": "Seen by the sensors: the value is within the sigma that is stated.",
    "ambiguous": "Its size is known, its sign is not.",
    "blind": "Below what the sensors can tell: the value is integrated only, and drifts.",
    "NIS": "Normalised innovation squared: how large a filter's surprises are beside what it"
    " expects. In an honest filter it is on the average its degrees of freedom; above, the filter"
    " is too sure of itself, below, too careful.",
    "GDOP": "Geometric dilution of precision: how much the arrangement of the sensors spreads their"
    " noise. Smaller is better.",
    "bound": "Cram\u00e9r-Rao bound: no filter with this model and these sensors can be surer.",
    "horizon": "Moving horizon: the newest measurements that are estimated together; what came"
    " before is kept as one summary.",
}
# NIS and GDOP as they are written; "valid" alone, for "valid" before a noun is an everyday word.
_FOUND = re.compile(
    r"\b(?:NIS|GDOP|[Bb]lind|[Aa]mbiguous|bound|horizon|valid(?=\s*(?:$|[,;:.)])))\b"
)


def glossary_link(word: str) -> str:
    """Where the word stands on the page of words."""
    return f"/words#{word.lower()}"


def meaning(title: str) -> str:
    """What a title says where it is one of the words; else empty."""
    return TERMS.get(title) or TERMS.get(title.lower(), "")


def link(word: str, shown: str, href: str) -> Markup:
    """A word with its meaning as a tooltip, and a link to where it is explained."""
    elsewhere = Markup(' target="_blank" rel="noopener"') if href.startswith("/") else ""
    return Markup('<a class="gf-term" href="{}"{} title="{}">{}</a>').format(
        href, elsewhere, TERMS[word], html(shown)
    )


def explained(text: object, href: Callable[[str], str] = glossary_link) -> Markup:
    """A text, escaped, with every word of the trade explained at its first place; what is Markup
    already is left as it is.
    """
    if isinstance(text, Markup):
        return text
    text, seen, at = str(text), set(), 0
    parts: list[object] = []
    for match in _FOUND.finditer(text):
        word = _word(match[0])
        if word in seen:
            continue
        seen.add(word)
        parts += [text[at : match.start()], link(word, match[0], href(word))]
        at = match.end()
    return Markup("").join(html(part) for part in [*parts, text[at:]])


def words_of(texts: list[str]) -> dict[str, str]:
    """The words that stand in some texts, with their meanings, in the order of TERMS."""
    found = {_word(match[0]) for text in texts for match in _FOUND.finditer(text)}
    return {word: meaning for word, meaning in TERMS.items() if word in found}


def _word(shown: str) -> str:
    return shown if shown in TERMS else shown.lower()
