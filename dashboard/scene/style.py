"""Styles of our own HTML inside viser's page, and what is changed in viser's own.

viser puts an HTML element into the page as it is, so a style element there holds for the whole
page.
"""

from pathlib import Path

LEFT_WIDTH = 300.0  # px, of the summary on the left
TABS = 20  # the chosen one of at most so many tabs can be marked


def css() -> str:
    """The style element: style.css and the mark of the chosen tab, which follows the class
    gf-tab-<number>.
    """
    chosen = ",".join(f"div:has(>.gf-tab-{k})+div button:nth-child({k + 1})" for k in range(TABS))
    mark = f"{chosen}{{border-bottom-color:#56B4E9;opacity:1;font-weight:700}}"
    return (
        f"<style>{Path(__file__).with_name('style.css').read_text(encoding='utf-8')}{mark}</style>"
    )
