"""What every part of the report as a PDF needs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from damageest.findings import Interval
from damageest.result import Result
from damageest.stages.report._words import Words
from damageest.stages.report.pdf.page_parts import clean


@dataclass(frozen=True)
class Letterhead:
    """Who makes the report: the name of the company, and a file with its logo."""

    company: str = ""
    logo: Path | None = None


@dataclass(frozen=True)
class Book:
    """What every part of the document needs."""

    result: Result
    content: Mapping[str, Any]
    job_text: str
    words: Words
    letterhead: Letterhead

    @property
    def unit(self) -> str:
        return self.result.units

    def interval(self, interval: Interval | None, unit: str) -> str:
        if interval is None:
            return self.words.tell("none: the scan does not support one")
        low, high = interval
        if not math.isfinite(high):
            return self.words.tell("at least {low} {unit}", low=self.words.number(low), unit=unit)
        return f"{self.words.number(low)} … {self.words.number(high)} {unit}"


def clean_line(text: str) -> str:
    """A text on one line for a canvas, which takes no markup."""
    from xml.sax.saxutils import unescape

    return unescape(clean(" ".join(text.split())))[:90]
