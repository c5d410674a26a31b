"""The report as PDF (A4), by ReportLab in its invariant mode: no date, no random id."""

import io
from pathlib import Path

from matplotlib import font_manager
from reportlab.lib import colors
from reportlab.lib.pagesizes import A4
from reportlab.lib.styles import ParagraphStyle
from reportlab.lib.units import mm
from reportlab.pdfbase import pdfmetrics
from reportlab.pdfbase.ttfonts import TTFont
from reportlab.pdfgen.canvas import Canvas
from reportlab.platypus import (
    BaseDocTemplate,
    Frame,
    Image,
    KeepTogether,
    PageTemplate,
    Paragraph,
    Spacer,
    Table,
    TableStyle,
)

from logs.figures.words import words_of
from messages.text import html, paragraph
from sessions.report.document import Document
from sessions.report.grids import Grid

FONT, BOLD = "DejaVuSans", "DejaVuSans-Bold"
INK, DIM, LINE = colors.HexColor("#16202a"), colors.HexColor("#5b6770"), colors.HexColor("#d6dce1")
VERDICTS = {"pass": colors.HexColor("#00704f"), "fail": colors.HexColor("#b03a00")}
MARGIN = 18 * mm
CELL = 2500  # characters of a fact, so that it fits on a page
WIDTH = A4[0] - 2 * MARGIN


def _style(name: str, size: float, **more: object) -> ParagraphStyle:
    usual = {"fontName": FONT, "fontSize": size, "leading": size * 1.35, "textColor": INK}
    return ParagraphStyle(name, **(usual | more))


def to_pdf(document: Document) -> bytes:
    """The file's bytes; the same document gives the same bytes."""
    _register_fonts()
    buffer = io.BytesIO()
    pages = BaseDocTemplate(
        buffer,
        pagesize=A4,
        leftMargin=MARGIN,
        rightMargin=MARGIN,
        topMargin=MARGIN,
        bottomMargin=MARGIN,
        title=document.title,
        author="gyrofree",
        invariant=1,
    )
    height = A4[1] - 2 * MARGIN
    frame = Frame(
        MARGIN, MARGIN, WIDTH, height, leftPadding=0, rightPadding=0, topPadding=0, bottomPadding=0
    )
    pages.addPageTemplates(PageTemplate(frames=[frame], onPage=_footer(document)))
    pages.build(_story(document))
    return buffer.getvalue()


def _register_fonts() -> None:
    """DejaVu, which matplotlib carries: the figures and the text look alike, and mathematical signs
    exist.
    """
    folder = Path(font_manager.findfont("DejaVu Sans")).parent
    for name in (FONT, BOLD):
        if name not in pdfmetrics.getRegisteredFontNames():
            pdfmetrics.registerFont(TTFont(name, str(folder / f"{name}.ttf")))


def _footer(document: Document):
    def draw(canvas: Canvas, pages: BaseDocTemplate) -> None:
        canvas.saveState()
        canvas.setFont(FONT, 7)
        canvas.setFillColor(DIM)
        canvas.drawString(MARGIN, 10 * mm, document.title)
        canvas.drawRightString(A4[0] - MARGIN, 10 * mm, f"page {pages.page}")
        canvas.restoreState()

    return draw


def _story(document: Document) -> list:
    verdict = VERDICTS.get(document.verdict, DIM)
    head = Table(
        [
            [
                Paragraph(html(document.title), _style("title", 17, fontName=BOLD)),
                Paragraph(
                    document.verdict.upper(),
                    _style("verdict", 13, fontName=BOLD, textColor=verdict, alignment=2),
                ),
            ]
        ],
        colWidths=[WIDTH * 0.72, WIDTH * 0.28],
        style=[("LINEBELOW", (0, 0), (-1, -1), 1.5, INK), ("LEFTPADDING", (0, 0), (-1, -1), 0)],
    )
    story: list = [head, Spacer(0, 4 * mm), _pairs(document.facts)]
    if document.checks:
        story += _grid(
            Grid("Acceptance", ("figure", "measured", "limit", "result"), list(document.checks))
        )
    for number, picture in enumerate(document.pictures, 1):
        caption = Paragraph(
            html(f"Figure {number}. {picture.caption}"), _style("caption", 7.5, textColor=DIM)
        )
        image = Image(io.BytesIO(picture.png))
        image.drawHeight *= WIDTH / image.drawWidth
        image.drawWidth = WIDTH
        story.append(KeepTogether([Spacer(0, 5 * mm), image, caption]))
    for grid in document.grids:
        story += _grid(grid)
    words = words_of(list(document.texts()))
    if words:
        story += [_title("Words"), _pairs(list(words.items()))]
    story += [
        _title("Provenance"),
        _pairs(document.provenance),
        Spacer(0, 18 * mm),
        _signatures(document),
    ]
    return story


def _title(text: str) -> Paragraph:
    return Paragraph(
        html(text), _style("heading", 10.5, fontName=BOLD, spaceBefore=7 * mm, spaceAfter=2 * mm)
    )


def _pairs(rows: list[tuple[str, str]]) -> Table:
    cells = [
        [
            Paragraph(html(name), _style("name", 8, textColor=DIM)),
            Paragraph(paragraph(value, CELL), _style("value", 8)),
        ]
        for name, value in rows
    ]
    padding = {"LEFTPADDING": 0, "BOTTOMPADDING": 1, "TOPPADDING": 1}
    style = [(name, (0, 0), (-1, -1), points) for name, points in padding.items()]
    return Table(cells, colWidths=[WIDTH * 0.28, WIDTH * 0.72], style=style)


def _grid(grid: Grid) -> list:
    size = 7.0 if len(grid.head) < 7 else 6.0
    body, bold = _style("cell", size), _style("head", size, fontName=BOLD, textColor=DIM)
    cells = [[Paragraph(html(cell), bold) for cell in grid.head]]
    cells += [[Paragraph(html(cell), body) for cell in row] for row in grid.rows]
    style = TableStyle(
        [
            ("LINEBELOW", (0, 0), (-1, 0), 0.7, INK),
            ("LINEBELOW", (0, 1), (-1, -1), 0.3, LINE),
            ("LEFTPADDING", (0, 0), (-1, -1), 0),
            ("TOPPADDING", (0, 0), (-1, -1), 1.5),
            ("BOTTOMPADDING", (0, 0), (-1, -1), 1.5),
            ("VALIGN", (0, 0), (-1, -1), "TOP"),
        ]
    )
    widths = _widths(grid)
    blocks = [_title(grid.title), Table(cells, colWidths=widths, style=style, repeatRows=1)]
    if grid.remark:
        blocks.append(
            Paragraph(html(grid.remark), _style("remark", 7, textColor=DIM, spaceBefore=1.5 * mm))
        )
    return [KeepTogether(blocks)] if len(grid.rows) < 12 else blocks


def _widths(grid: Grid) -> list[float]:
    """In proportion to the longest text of each column."""
    columns = list(zip(grid.head, *grid.rows, strict=True))
    longest = [
        max(6, *(max(len(word) for word in text.split("\n")) for text in column))
        for column in columns
    ]
    capped = [min(length, 24) for length in longest]
    return [WIDTH * length / sum(capped) for length in capped]


def _signatures(document: Document) -> Table:
    style = [("LINEABOVE", (k, 1), (k, 1), 0.6, INK) for k in (0, 2, 4)]
    labels, names = _style("sign", 7.5, textColor=DIM), _style("name", 9)
    rows: list[list[Paragraph | str]] = [[], []]
    for what, who in document.signed:
        rows[0] += [Paragraph(paragraph(who, CELL), names), ""]
        rows[1] += [Paragraph(html(what), labels), ""]
    return Table(
        [row[:-1] for row in rows],
        colWidths=[WIDTH * share for share in (0.3, 0.05, 0.3, 0.05, 0.3)],
        style=style,
    )
