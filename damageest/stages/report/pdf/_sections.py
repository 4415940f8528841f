"""The sections of a result as pages of the PDF."""

from __future__ import annotations

from typing import Any

from reportlab.platypus import Spacer, Table

from damageest.artefacts import Section
from damageest.io.section_files import lay_out
from damageest.stages.report._sections import choose_decimals, collect_groups, name_quantity
from damageest.stages.report.pdf.book import Book, clean_line
from damageest.stages.report.pdf.page_parts import SOFT, WIDTH, Plot, grid_table, head, write


def show_sections(book: Book) -> list[Any]:
    result, words = book.result, book.words
    story: list[Any] = [head(words.tell("Sections"))]
    story.append(write(words.tell(
        "Lengths in {unit}. Measured value; below it, its difference from nominal, ± twice its standard uncertainty.",
        unit=book.unit), 7.5, colour=SOFT, spaceAfter=3))  # fmt: skip
    decimals = choose_decimals(result.tolerance)
    for (_, names), sections in collect_groups(result).items():
        for start in range(0, len(sections), 5):
            story += [_tabulate(book, names, sections[start : start + 5], decimals), Spacer(1, 4)]
        notes = [f"{one.name}: {note}" for one in sections for note in one.notes]
        told = dict.fromkeys(v.note for one in sections for v in one.values if v.note and v.measured is None)
        story += [write(f"– {note}", 7) for note in (*notes, *told)]
    plots = []
    for section in result.sections:
        if section.contours:
            drawing = lay_out(section, result.tolerance, book.unit)
            text = words.tell("deviations x {times}", times=f"{drawing.times:g}")
            plots.append(
                [write(f"{section.number}: {section.name}", 7.5, True), Plot(drawing, 0.49 * WIDTH, clean_line(text))]
            )
    legend = (
        "blue: below, green: within, red: above the tolerance (dashed); dotted: no scan points; deviations enlarged"
    )
    if plots:
        story.append(write(words.tell(legend), 7, colour=SOFT, spaceBefore=2, spaceAfter=2))
    for start in range(0, len(plots), 2):
        row = [*plots[start : start + 2], ""][:2]
        table = Table([row], [0.5 * WIDTH] * 2)
        table.setStyle([("VALIGN", (0, 0), (-1, -1), "TOP"), ("LEFTPADDING", (0, 0), (-1, -1), 0)])
        story.append(table)
    return story


def _tabulate(book: Book, names: tuple[str, ...], sections: list[Section], decimals: int) -> Table:
    """Quantities in rows, sections in columns."""
    words = book.words
    rows = [["", *(f"{one.number}: {one.name}" for one in sections)]]
    rows.append([words.tell("seen"), *(words.share(one.seen) if one.contours else "–" for one in sections)])
    for k, name in enumerate(names):
        line = [name_quantity(name, words)]
        for one in sections:
            value = one.values[k]
            if value.measured is None:
                line.append("–")
                continue
            text = words.fixed(value.measured, decimals) + ("°" if value.unit == "degrees" else "")
            more = words.fixed(value.measured - value.nominal, decimals, plus=True) if value.nominal else ""
            more += f" ± {words.fixed(2 * value.error, decimals)}" if value.error else ""
            line.append(f"{text}\n{more}" if more else text)
        rows.append(line)
    each = min(0.8 / max(len(sections), 1), 0.25) * WIDTH
    return grid_table(rows, [0.2 * WIDTH, *([each] * len(sections))], 7)
