"""Parts of the PDF: styles, tables, drawings, numbered pages. Only it and `document.py` import reportlab."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import reportlab
from reportlab.lib import colors
from reportlab.lib.pagesizes import A4
from reportlab.lib.styles import ParagraphStyle
from reportlab.lib.units import mm
from reportlab.lib.utils import ImageReader
from reportlab.pdfbase import pdfmetrics
from reportlab.pdfbase.ttfonts import TTFont
from reportlab.pdfgen.canvas import Canvas
from reportlab.platypus import Flowable, Image, Paragraph, Table

from damageest.artefacts import Floats
from damageest.io.section_files import COLOURS, Drawing

MARGIN, HEAD, FOOT = 18 * mm, 26 * mm, 16 * mm
WIDTH = A4[0] - 2 * MARGIN
PLAIN, BOLD = "Vera", "VeraBd"
"""Fonts that reportlab brings, embedded: the page looks alike on every machine."""
INK, SOFT, LINE, PANEL = (colors.HexColor(text) for text in ("#1c2329", "#5a656d", "#c3c9ce", "#f1f3f5"))
LEVELS = {"proven": "#1f7a4d", "likely": "#9a6700", "doubtful": "#b3362c"}
REPLACED = {"\u202f": "\u00a0", "λ": "lambda", "→": "->", "Δ": "delta ", "\u2009": "\u00a0"}
"""Characters that these fonts lack."""


def register_fonts() -> None:
    """Makes the fonts known to reportlab."""
    folder = Path(reportlab.__file__).parent / "fonts"
    for name in (PLAIN, BOLD):
        if name not in pdfmetrics.getRegisteredFontNames():
            pdfmetrics.registerFont(TTFont(name, str(folder / f"{name}.ttf")))
    pdfmetrics.registerFontFamily(PLAIN, normal=PLAIN, bold=BOLD, italic=PLAIN, boldItalic=BOLD)


def clean(text: object) -> str:
    """A text with characters that the fonts have, safe in reportlab's markup."""
    known = pdfmetrics.getFont(PLAIN).face.charToGlyph
    plain = "".join(REPLACED.get(letter, letter) for letter in str(text))
    return escape("".join(letter if ord(letter) in known or letter == "\n" else "?" for letter in plain))


def style(size: float = 8.5, bold: bool = False, colour: Any = INK, **more: Any) -> ParagraphStyle:
    """A style of paragraphs."""
    return ParagraphStyle(
        f"{size}{bold}{colour}{sorted(more.items())}", fontName=BOLD if bold else PLAIN, fontSize=size,
        leading=1.3 * size, textColor=colour, **more,
    )  # fmt: skip


def write(text: object, size: float = 8.5, bold: bool = False, colour: Any = INK, **more: Any) -> Paragraph:
    """A paragraph of plain text."""
    return Paragraph(clean(text).replace("\n", "<br/>"), style(size, bold, colour, **more))


def head(text: object, **more: Any) -> Paragraph:
    """The head of a part of the page."""
    return write(text, 11, True, spaceBefore=7, spaceAfter=3, **more)


def pair_table(rows: list[tuple[str, str]], width: float = WIDTH, share: float = 0.3, size: float = 8.5) -> Table:
    """Names and values in two columns."""
    cells = [[write(name, size, colour=SOFT), write(value, size)] for name, value in rows]
    table = Table(cells, [share * width, (1 - share) * width], hAlign="LEFT")
    table.setStyle([("VALIGN", (0, 0), (-1, -1), "TOP"), ("LEFTPADDING", (0, 0), (-1, -1), 0),
                    ("TOPPADDING", (0, 0), (-1, -1), 1), ("BOTTOMPADDING", (0, 0), (-1, -1), 1)])  # fmt: skip
    return table


def grid_table(rows: list[list[str]], widths: list[float], size: float = 7.5, head_rows: int = 1) -> Table:
    """A table with a head, its numbers to the right."""
    right = {"alignment": 2}
    cells = [
        [write(text, size, row < head_rows, SOFT if row < head_rows else INK, **(right if column else {}))
         for column, text in enumerate(line)]
        for row, line in enumerate(rows)
    ]  # fmt: skip
    table = Table(cells, widths, repeatRows=head_rows, hAlign="LEFT")
    table.setStyle([("LINEBELOW", (0, 0), (-1, -1), 0.4, LINE), ("VALIGN", (0, 0), (-1, -1), "TOP"),
                    ("LEFTPADDING", (0, 0), (-1, -1), 1), ("RIGHTPADDING", (0, 0), (-1, -1), 3),
                    ("TOPPADDING", (0, 0), (-1, -1), 2), ("BOTTOMPADDING", (0, 0), (-1, -1), 2)])  # fmt: skip
    return table


def picture(png: bytes, width: float) -> Image:
    """A PNG picture of a width."""
    w, h = ImageReader(BytesIO(png)).getSize()
    return Image(BytesIO(png), width, width * h / w)


class Plot(Flowable):  # type: ignore[misc]
    """A `Drawing` of a section, of a width."""

    def __init__(self, drawing: Drawing, width: float, legend: str) -> None:
        super().__init__()
        self.drawing, self.legend = drawing, legend
        self.scale = width / drawing.size[0]
        self.width, self.height = width, self.scale * drawing.size[1]

    def wrap(self, *_: Any) -> tuple[float, float]:
        return self.width, self.height

    def draw(self) -> None:
        pen = self.canv
        if self.drawing.areas:
            path = pen.beginPath()
            for area in self.drawing.areas:
                self._trace(path, area)
                path.close()
            pen.setFillColor(colors.HexColor(COLOURS["metal"]))
            pen.drawPath(path, stroke=0, fill=1, fillMode=0)
        for line in self.drawing.outlines:
            self._stroke(line, COLOURS["ink"], 0.5)
        for line in self.drawing.limits:
            self._stroke(line, COLOURS["soft"], 0.3, (2, 1.5))
        for kind, line in self.drawing.lines:
            self._stroke(line, COLOURS[kind], 1.0, (0.8, 1.6) if kind == "unseen" else ())
        for name, x, y in self.drawing.marks:
            nominal = name.endswith("nominal")
            turn = ((4, 0), (0, 4)) if nominal else ((3, 3), (3, -3))
            for a, b in turn:
                ends = [(x - a, y - b), (x + a, y + b)]
                self._stroke(ends, COLOURS["ink" if nominal else "above"], 0.6)
        ruler, text = self.drawing.ruler
        self._stroke(ruler, COLOURS["ink"], 0.9)
        pen.setFillColor(INK)
        pen.setFont(PLAIN, 6)
        x, y = self._place(ruler[1])
        pen.drawString(x + 4, y - 2, f"{text}; {self.legend}")

    def _place(self, point: Any) -> tuple[float, float]:
        return self.scale * float(point[0]), self.height - self.scale * float(point[1])

    def _trace(self, path: Any, points: Any) -> None:
        for k, point in enumerate(points):
            (path.lineTo if k else path.moveTo)(*self._place(point))

    def _stroke(self, points: Floats | list[Any], colour: str, width: float, dashes: tuple[float, ...] = ()) -> None:
        path = self.canv.beginPath()
        self._trace(path, points)
        self.canv.setStrokeColor(colors.HexColor(colour))
        self.canv.setLineWidth(width)
        self.canv.setDash(list(dashes))
        self.canv.drawPath(path, stroke=1, fill=0)
        self.canv.setDash([])


class Pages(Canvas):  # type: ignore[misc]
    """A canvas that numbers its pages once it knows how many there are."""

    number_text = "{page} / {pages}"

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._kept: list[dict[str, Any]] = []

    def showPage(self) -> None:  # noqa: N802
        self._kept.append(dict(self.__dict__))
        self._startPage()

    def save(self) -> None:
        for page, kept in enumerate(self._kept, 1):
            self.__dict__.update(kept)
            self.setFont(PLAIN, 7)
            self.setFillColor(SOFT)
            self.drawRightString(
                A4[0] - MARGIN, 10 * mm, clean(self.number_text.format(page=page, pages=len(self._kept)))
            )
            Canvas.showPage(self)
        super().save()
