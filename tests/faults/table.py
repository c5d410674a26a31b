"""The tables of docs/faults.md: made of the scenarios themselves and of what was measured last."""

import re
from pathlib import Path

from faults.all import PROOFS, SCENARIOS
from faults.scenario import Scenario

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "faults.md"
BEGIN, END = "<!-- made by `make faults` -->", "<!-- end -->"
HEAD = "| fault | what is done | what is lost | what is said | well again after | in `make test` |"
PROOF_HEAD = "| fault | what is lost | what is said | held by |"
NEVER = "-"  # not measured
ROW = re.compile(r"^\| \*\*(.+?)\*\* \| .* \| (.+?) \| (?:yes|no) \|$", re.MULTILINE)


def measured(page: str) -> dict[str, str]:
    """By scenario when it was well again, as the page says."""
    return dict(ROW.findall(page))


def tables(times: dict[str, str]) -> str:
    """Both tables; times: by scenario when it was well again."""
    parts = []
    for title, scenarios in SCENARIOS.items():
        parts += [f"### {title}", "", HEAD, "|---|---|---|---|---|---|"]
        parts += [_row(one, times.get(one.name, NEVER)) for one in scenarios] + [""]
    parts += ["### Held by other tests", "", PROOF_HEAD, "|---|---|---|---|"]
    for one in PROOFS:
        tests = ", ".join(f"`{name}`" for name in one.tests)
        parts.append(f"| {one.fault} | {one.lost} | {one.said} | {tests} |")
    return "\n".join(parts)


def write(times: dict[str, str]) -> None:
    """Into the page; what was not measured now keeps its time."""
    page = PAGE.read_text(encoding="utf-8")
    before, rest = page.split(BEGIN)
    after = rest.split(END)[1]
    both = measured(page) | times
    PAGE.write_text(f"{before}{BEGIN}\n\n{tables(both)}\n\n{END}{after}", encoding="utf-8")


def _row(one: Scenario, after: str) -> str:
    said = "; ".join(word.text for word in one.said) or "nothing"
    quick = "yes" if one.quick else "no"
    return f"| **{one.name}** | {one.fault} | {one.lost.text} | {said} | {after} | {quick} |"
