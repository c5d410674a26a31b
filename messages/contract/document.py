"""Prints docs/topics.md: ``python -m messages.contract.document``."""

from messages.contract.topics import markdown

INTRODUCTION = """# Topics of the bus

Made from messages/contract/topics.py by `make docs`; do not edit. A key is
`<prefix>/<device>/<topic>`, with one more part where there is one topic per estimator. Types are
defined, with units and frames, in messages/contract/gyrofree.proto.

"""


def main() -> None:
    """Print the page."""
    print(INTRODUCTION + markdown(), end="")


if __name__ == "__main__":
    main()
