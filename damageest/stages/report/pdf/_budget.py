"""Budgets of uncertainty as tables of the PDF."""

from __future__ import annotations

import math
from typing import Any

from reportlab.platypus import KeepTogether

from damageest.findings import Budget
from damageest.stages.report.pdf.book import Book
from damageest.stages.report.pdf.page_parts import SOFT, WIDTH, grid_table, head, write


def show_budget(book: Book, budget: Budget, name: str, unit: str) -> list[Any]:
    """The budget of a quantity called ``name``, in its ``unit``: rows, sums, and the bounds that are in no row."""
    tell, number = book.words.tell, book.words.number
    rows = [[tell("source"), tell("type"), tell("distribution"), tell("standard uncertainty"), tell("sensitivity"),
             tell("contribution, {unit}", unit=unit), tell("share")]]  # fmt: skip
    for row in budget.rows:
        rows.append([tell(row.text), row.type, tell(row.distribution), f"{number(row.uncertainty, 3)} {row.unit}",
                     number(row.sensitivity, 3), number(row.contribution, 3), book.words.share(row.share)])  # fmt: skip
    rows.append([tell("combined standard uncertainty"), "", "", "", "", number(budget.combined, 3), ""])
    expanded = tell("expanded uncertainty, k = {k}", k=number(budget.k, 2))
    rows.append([expanded, "", "", "", "", number(budget.expanded, 3), ""])
    widths = [share * WIDTH for share in (0.27, 0.05, 0.12, 0.19, 0.15, 0.13, 0.09)]
    title = head(tell("Budget of uncertainty: {name}", name=name))
    story: list[Any] = [KeepTogether([title, grid_table(rows, widths, 7)])]
    if budget.correction:
        shift = f"{'+' if budget.correction > 0 else '−'} {number(abs(budget.correction), 3)} {unit}"
        story.append(_write(tell("The middle of the interval is the value {shift}, its mean error.", shift=shift)))
    for bound in budget.bounds:
        ends = [("−", -bound.low), ("+", bound.high)]
        told = [f"{sign} {number(size, 3)} {unit}" for sign, size in ends if size and math.isfinite(size)]
        text = tell("Not in the budget, moves an end of the interval: {bound}", bound=tell(bound.text))
        story.append(_write(f"{text}{': ' * bool(told)}{', '.join(told)}"))
    return story


def _write(text: str) -> Any:
    return write(f"– {text}", 7, colour=SOFT)
