"""HTML of the panels, made of elements: whatever is text is escaped on its way in.

A panel never writes tags into a text of its own: what `Panel.html` gets as a plain str is shown as
it stands, so that a forgotten place shows its tags instead of obeying somebody else's. Words of the
trade are explained where they stand in notes, alerts, tables and headings of charts.
"""

from collections.abc import Iterable

from markupsafe import Markup

from logs.figures.words import explained, glossary_link, link
from messages.text import html

__all__ = [
    "EMPTY",
    "Markup",
    "alert",
    "bad",
    "explained",
    "html",
    "joined",
    "note",
    "rows",
    "sub",
    "tag",
    "term",
]

EMPTY = Markup("")


def joined(parts: Iterable[object], between: str = "") -> Markup:
    """Parts one after another; those that are text are escaped."""
    return html(between).join(html(part) for part in parts)


def tag(name: str, *inside: object, **attributes: object) -> Markup:
    """An element. Attributes as keywords: `class_` is class, `stroke_width` is stroke-width; those
    that are None or empty are left out.
    """
    given = joined(
        Markup(' {}="{}"').format(Markup(key.rstrip("_").replace("_", "-")), html(value, 1 << 20))
        for key, value in attributes.items()
        if value not in (None, "")
    )
    return Markup("<{0}{1}>{2}</{0}>").format(Markup(name), given, joined(inside))


def note(*inside: object) -> Markup:
    """A paragraph in small print; nothing when there is nothing to say."""
    return tag("p", *map(explained, inside), class_="gf-note") if any(inside) else EMPTY


def alert(*inside: object) -> Markup:
    """A paragraph that calls; nothing when there is nothing to say."""
    return tag("p", *map(explained, inside), class_="gf-alert") if any(inside) else EMPTY


def bad(*inside: object) -> Markup:
    """Words in the colour of what is wrong."""
    return tag("b", *inside, class_="gf-bad")


def sub(letter: str, index: str) -> Markup:
    """A letter with an index below."""
    return joined([letter, tag("sub", index)])


def term(word: str, shown: str = "") -> Markup:
    """A word of the trade with what it means, and a link to the glossary."""
    return link(word, shown or word, glossary_link(word))


def rows(items: Iterable[tuple[object, object]], stale: bool = False) -> Markup:
    """A two-column table."""
    body = (tag("tr", *(tag("td", explained(cell)) for cell in item)) for item in items)
    return tag("table", *body, class_="gf-rows gf-stale" if stale else "gf-rows")
