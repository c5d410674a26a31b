"""Styles of our own HTML inside viser's page, and what is changed in viser's own.

viser puts an HTML element into the page as it is, so a style element there holds for the whole
page.
"""

from pathlib import Path

SHEETS = (
    Path(__file__).with_name("style.css"),
    Path(__file__).parents[1] / "web" / "static" / "tools.css",  # charts have them on every page
)
LEFT_WIDTH = 300.0  # px, of the summary on the left


def css() -> str:
    """The style element."""
    return f"<style>{''.join(sheet.read_text(encoding='utf-8') for sheet in SHEETS)}</style>"
