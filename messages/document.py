"""Prints docs/topics.md: ``python -m messages.document``."""

from messages.topics import markdown

INTRODUCTION = """# Topics of the bus

Made from messages/topics.py by `make docs`; do not edit. A key is `<prefix>/<device>/<topic>`, with one more
part where there is one topic per estimator. Types are defined, with units and frames, in messages/gyrofree.proto.

"""


def main() -> None:
    """Print the page."""
    print(INTRODUCTION + markdown(), end="")


if __name__ == "__main__":
    main()
