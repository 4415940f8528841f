"""One report, from its scan to the judgement, as a row of values that JSON can hold."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from damageest_evaluate.processes import Row

from damageest.errors import InputError, describe_error
from damageest_benchmarks.families.case import run_draw
from damageest_benchmarks.reported.registry import REPORTS, Reported


@dataclass(frozen=True)
class ReportedCase:
    """The report of this address. ``source``: digest of the code."""

    address: str
    source: str = ""
    varied: Mapping[str, float | str] = field(default_factory=dict)

    @property
    def report(self) -> Reported:
        return next(report for report in REPORTS if report.address == self.address)

    def compute_key(self) -> str:
        """The case's identifier in a file of rows."""
        return hashlib.sha256(json.dumps([self.address, self.source]).encode()).hexdigest()[:16]

    def make_blank_row(self) -> Row:
        """The row of the case without a result."""
        row: Row = {"key": self.compute_key(), "address": self.address, "kind": self.report.kind}
        row |= {"wanted": self.report.wanted, "outcome": "silent", "reason": "", "cautious": False, "refused": False}
        row |= {"accepted": 0, "sites": 0, "true_volume": 0.0, "volume": 0.0, "low": None, "high": None}
        return row | {"holds": False, "codes": [], "error": "", "seconds": 0.0}

    def run(self) -> Row:
        """Reads the files, runs the job and judges it."""
        start = time.perf_counter()
        try:
            draw = self.report.make()
        except InputError as error:  # the file itself is refused
            message = describe_error(error, 300)
            judged = {"outcome": "said", "refused": True, "reason": f"refused: {message}", "error": message}
            return self.make_blank_row() | judged | {"seconds": time.perf_counter() - start}
        return run_draw(draw, self.make_blank_row())


def make_reported_cases(words: Sequence[str], source: str) -> list[ReportedCase]:
    """A case for each report, or for those with one of the words in kind or address."""
    chosen = [one for one in REPORTS if not words or any(word in f"{one.kind} {one.address}" for word in words)]
    return [ReportedCase(one.address, source) for one in chosen]


def is_good(row: Row) -> bool:
    """Whether a run said what it should."""
    right = row["outcome"] in ("right", "inside")
    return bool(row["outcome"] != "silent" and (row["wanted"] == "either" or right == (row["wanted"] == "right")))


def describe_reported_row(row: Row) -> str:
    """A row in a line."""
    what = row["outcome"].upper() if row["outcome"] == "silent" else row["outcome"]
    found = row["error"] or f"{_describe_volume(row)} for {row['true_volume']:.4g}"
    said = f" [{', '.join(row['codes'])}]" if row["codes"] else ""
    return (
        f"{row['kind']}: {what} ({row['wanted']} wanted); {found}{said}; {row['reason'][:150]}; {row['seconds']:.0f} s"
    )


def _describe_volume(row: Row) -> str:
    if not row["accepted"]:
        return f"none of {row['sites']} sites" if row["sites"] else "nothing"
    high = "∞" if row["high"] is None else f"{row['high']:.4g}"
    return f"{row['volume']:.4g} ({row['low']:.4g} to {high})"


def make_reported_table(rows: Sequence[Row]) -> list[list[str]]:
    """Head and body: each report with its address, what a run made of it, and the reasons of its doubts."""
    lines = [["report", "kind", "wanted", "came out", "lost, mm³", "found", "doubts", "s"]]
    for row in rows:
        came = "refused" if row["refused"] else row["outcome"]
        said = row["error"].replace("|", "/")[:90] or ", ".join(row["codes"][:4])
        name = row["address"].removeprefix("github.com/").replace("/issues/", "#").replace("/pull/", "#")
        link = f"[{name.rstrip('/').rpartition('//')[2][:60]}](https://{row['address']})"
        found = "" if row["refused"] else _describe_volume(row)
        lines.append([
            link, row["kind"], row["wanted"], came if is_good(row) else f"**{came}**", f"{row['true_volume']:.4g}",
            found, said, f"{row['seconds']:.0f}",
        ])  # fmt: skip
    return lines


def summarise(rows: Sequence[Row]) -> str:
    """How many came out as they should."""
    silent = sum(row["outcome"] == "silent" for row in rows)
    return f"{sum(map(is_good, rows))} of {len(rows)} as wanted, {silent} wrong and silent."
