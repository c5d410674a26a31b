"""Text from outside (people, boards, the bus, files): what may be kept, and how it is shown.

One helper for each medium:

    check(text)   at the doors where people write: "" or a sentence that says what is not wanted
    plain(text)   for terminals, logs and pictures: nothing that acts, nothing that is invisible
    html(text)    inside HTML and SVG, between tags and in quoted attributes; templates do it
    drawn(text)   on figures
    reason(error) of an exception, for any of these
    cell(value)   of a table that a spreadsheet may open
    counted(n)    how many of something, in the singular where it is one

What acts or hides: control characters (a terminal obeys them), the bidirectional controls of
Unicode (they let a text read in another order than it stands), characters without any shape, lone
surrogates, and heaps of combining marks (they cover the lines around them).
"""

import re
import unicodedata

from markupsafe import Markup
from markupsafe import escape as _escape

LONGEST = 500  # characters of one text that are shown
MARKS = 4  # combining marks on one character; Vietnamese needs two, Hebrew with accents four
JOINERS = "\u200c\u200d"  # Persian and joined emoji need them, between characters of their own kind
EXECUTED = "=+-@\t\r\n\uff1d\uff0b\uff0d\uff20"  # what begins a formula; the last four are wide
# other spreadsheets begin a new cell at these, also in the middle of a text
_NEXT_CELL = re.compile(
    rf"(?s:(?<=.[;\t\n\r]))([\s\"']*)(?=[{re.escape(EXECUTED[:4] + EXECUTED[7:])}])"
)
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")


def acts(character: str) -> bool:
    """True for a character that changes what is around it instead of being seen."""
    kind = unicodedata.category(character)
    if kind == "Cf":
        return character not in JOINERS
    return kind in ("Cc", "Cs", "Zl", "Zp") or ord(character) & 0xFFFE == 0xFFFE


def check(text: str, lines: bool = False) -> str:
    """Why this text is not taken, or "". `lines`: line breaks and tabs are welcome."""
    marks = 0
    for place, character in enumerate(text):
        around = (text[place - 1 : place], text[place + 1 : place + 2])
        joins = character in JOINERS and all(one > "\x7f" for one in around)
        marks = marks + 1 if unicodedata.combining(character) else 0
        if marks > MARKS:
            return f"character {place + 1} carries more than {MARKS} marks: write it without them"
        if lines and character in "\n\t":
            continue
        if acts(character) or (character in JOINERS and not joins):
            return (
                f"character {place + 1} is {_name(character)}, which is not seen but acts on what"
                " is: write it without"
            )
    return ""


def composed(text: str) -> str:
    """The same text in one form (NFC), so that what looks equal is equal."""
    return unicodedata.normalize("NFC", text)


def plain(text: object, longest: int = LONGEST) -> str:
    """One line for a terminal, a log or a picture: what acts is shown as <U+202E>, a long text is
    cut.
    """
    whole = str(text)
    if len(whole) <= longest and whole.isascii() and whole.isprintable():
        return whole
    cut = whole if len(whole) <= longest else whole[: longest - 1] + "…"
    out, marks = [], 0
    for character in cut:
        if unicodedata.combining(character):
            marks += 1
            if marks > MARKS:
                continue
        else:
            marks = 0
        hidden = acts(character) or character in JOINERS
        out.append(f"<U+{ord(character):04X}>" if hidden else character)
    return "".join(out)


def printed(text: object) -> str:
    """Several lines for a terminal, uncut: line breaks and tabs stay, all else as `plain`."""
    whole = str(text).split("\n")
    return "\n".join("\t".join(plain(part, 1 << 20) for part in line.split("\t")) for line in whole)


def reason(error: object) -> str:
    """What an error says to people: of a file that cannot be had, its name and why, without the
    number that the system has for it.
    """
    if isinstance(error, OSError) and error.strerror:
        where = "" if error.filename is None else f"{error.filename}: "
        return f"{where}{error.strerror[:1].lower()}{error.strerror[1:]}"
    return str(error)


def html(text: object, longest: int = LONGEST) -> Markup:
    """Text inside HTML or SVG. What is Markup already stays as it is."""
    return text if isinstance(text, Markup) else _escape(plain(text, longest))


def paragraph(text: object, longest: int = 1 << 20) -> Markup:
    """Text of several lines inside HTML."""
    if isinstance(text, Markup):
        return text
    whole = str(text)
    cut = whole if len(whole) <= longest else whole[: longest - 1] + "…"
    return _escape(printed(cut))


def template_value(value: object) -> object:
    """For `finalize` of a jinja environment: whatever a template shows passes here."""
    return paragraph(value) if isinstance(value, str) else value


def drawn(text: object, longest: int = 120) -> str:
    """A title or label of a figure: plain, and no formula between two dollar signs."""
    return plain(text, longest).replace("$", r"\$")


def cell(value: object) -> object:
    """A cell of a table: numbers unchanged, a text that a spreadsheet would execute behind an
    apostrophe, which spreadsheets take as "this is text".
    """
    if not isinstance(value, str) or _NUMBER.fullmatch(value):
        return value
    shown = "".join(f"<U+{ord(c):04X}>" if acts(c) and c not in "\t\n\r" else c for c in value)
    shown = _NEXT_CELL.sub(r"\1'", shown)
    return f"'{shown}" if value.lstrip(" \u00a0\u3000")[:1] in (*EXECUTED,) else shown


def counted(number: int, one: str, many: str = "") -> str:
    """`1 message`, `48 537 messages`; thousands stand apart by a thin blank."""
    return f"{number:,} ".replace(",", "\u202f") + (one if number == 1 else many or f"{one}s")


FORBIDDEN_IN_FILES = re.compile(r'[/\\:*?"<>|]')  # by the file systems of others


def file_name(name: str, longest: int = 80) -> str:
    """Why this is no plain name of a file, or "". Blanks, umlauts, brackets, # and % are."""
    if not name or name in (".", ".."):
        return "it is empty"
    if FORBIDDEN_IN_FILES.search(name):
        return 'it has one of / \\ : * ? " < > |'
    if name[0] in ".-" or name[0] == " " or name[-1] in ". ":
        return "it begins with a dot, dash or blank, or ends with a dot or blank"
    if len(name) > longest or len(name.encode(errors="replace")) > 250:
        return f"it is longer than {longest} characters"
    return check(name)


def _name(character: str) -> str:
    title = unicodedata.name(character, "a control character").lower()
    return f"U+{ord(character):04X} ({title})"
