"""The report as one HTML file that needs nothing beside it."""

import base64
from pathlib import Path

import jinja2

from logs.figures.words import explained, words_of
from messages.text import template_value
from sessions.report.document import Document

_environment = jinja2.Environment(
    loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
    autoescape=True,
    finalize=template_value,
    undefined=jinja2.StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
_environment.filters["explained"] = lambda text: explained(text, _place)


def _place(word: str) -> str:
    """Where a word is explained: at the end of the report itself."""
    return f"#word-{word.lower()}"


def to_html(document: Document) -> str:
    """The page; pictures are inside."""
    pictures = [
        (k, picture.caption, picture.kind, base64.b64encode(picture.png).decode())
        for k, picture in enumerate(document.pictures, 1)
    ]
    words = words_of(list(document.texts()))
    return _environment.get_template("report.html").render(
        document=document, pictures=pictures, words=words
    )
