"""Prints docs/metrics.md: ``python -m gyrofree.operations.document``."""

from collections.abc import Iterable, Iterator

from dashboard.web.programs import figures
from gyrofree.operations.settings import SERVICES
from messages.metrics import exposition, own, table

HEAD = """# Figures

Made from the code by `make docs`; do not edit. What they are for, and how a Prometheus server
collects them: [operations](operations.md). Base units; `_total` grows while its process lives and
begins anew with it. A figure that is not known now is absent.

## Where

| service | port |
|---|---|
"""
EVERY = """
Those of a service hold what it has published itself; the dashboard's `/metrics` holds what all of
them say.

## Of every process

Besides these `process_*` (CPU, memory, open files, start) and `python_gc_*` of prometheus-client.

"""


def _rows(families: Iterable[tuple]) -> Iterator[tuple[str, str, str, str]]:
    for name, kind, text, labels in families:
        yield name, kind, ", ".join(labels), text


def page() -> str:
    """The whole page."""
    ports = [
        f"| {name} | `[metrics] port`{f' + {k}' if k else ''} |" for k, name in enumerate(SERVICES)
    ]
    age, published = exposition.AGE, exposition.PUBLISHED
    both = [
        (age[0], "gauge", *age[1:]),
        (published[0], "counter", *published[1:]),
    ]
    every = table.markdown(_rows([own.LOGGED, own.FREE, own.SIZE, *both]))
    dashboard = table.markdown(_rows(figures.OWN))
    lines = HEAD + "\n".join(ports) + "\n" + EVERY + every
    lines += "\n## Of what the services say\n\n" + table.markdown(table.rows())
    return lines + "\n## Of the dashboard\n\n" + dashboard


if __name__ == "__main__":
    print(page(), end="")
