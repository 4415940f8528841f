"""What is said of families: a line for each draw, and a table."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from damageest_evaluate.processes import Row

from damageest_benchmarks.families.case import FAMILIES, FamilyCase

GROUPS: Mapping[str, tuple[str, ...]] = {
    "walls": ("side", "body", "pit"),
    "hands": ("hand", "body"),
    "turned": ("body", "feature"),
    "datums": ("state", "form"),
    "surroundings": ("way", "around"),
}
"""What the draws of a family are grouped by."""


def make_family_cases(families: Sequence[str], every: int, seeds: Sequence[int], source: str) -> list[FamilyCase]:
    """One draw in ``every`` of the given families (none given: all), or those with the given seeds."""
    chosen = families or tuple(FAMILIES)
    return [FamilyCase(name, k, source) for name in chosen for k in seeds or range(0, FAMILIES[name][0], every)]


def describe_row(row: Row) -> str:
    """A draw in a line."""
    said = ", ".join(
        f"{name} {value:.3g}" if isinstance(value, float) else f"{name} {value}" for name, value in row["said"].items()
    )
    high = "inf" if row["high"] is None else f"{row['high']:.4g}"
    found = row["error"] or f"{row['volume']:.4g} ({row['low'] or 0:.4g} to {high}) for {row['true_volume']:.4g}"
    what = row["outcome"].upper() if row["outcome"] == "silent" else row["outcome"]
    codes = "" if row["accepted"] == row["sites"] else f" [{', '.join(row['codes'])}]"
    what += "" if row["shown"] else " (not shown)"
    return f"{row['family']} {row['seed']}: {what}; {found}{codes}; {said}; {row['seconds']:.0f} s"


def make_family_table(rows: Sequence[Row]) -> list[list[str]]:
    """Head and body of the table: lines for each family and for each of its groups."""
    head = [
        "family",
        "group",
        "draws",
        "silent",
        "shown",
        "come out",
        "doubtful though right",
        "intervals hold",
        "depths hold",
        "refused",
        "s",
    ]
    return [head, *_make_lines(rows)]


def _make_lines(rows: Sequence[Row]) -> Iterator[list[str]]:
    for family in FAMILIES:
        own = [row for row in rows if row["family"] == family]
        if not own:
            continue
        yield _make_line(family, "all", own)
        for name in GROUPS[family]:
            for value in dict.fromkeys(row["said"].get(name) for row in own):
                yield _make_line("", f"{name}: {value}", [row for row in own if row["said"].get(name) == value])


def _make_line(family: str, group: str, rows: Sequence[Row]) -> list[str]:
    def count(test: Callable[[Row], Any], of: Sequence[Row] = rows) -> str:
        return str(sum(bool(test(row)) for row in of))

    shown = [row for row in rows if row["shown"]]
    taken = [row for row in rows if row["accepted"]]
    deep = [row for row in rows if row["depth_holds"] is not None]
    return [
        family, group, str(len(rows)), count(lambda row: row["outcome"] == "silent"), str(len(shown)),
        count(lambda row: row["comes_out"], shown), count(lambda row: row["cautious"]),
        f"{count(lambda row: row['holds'], taken)} of {len(taken)}",
        f"{count(lambda row: row['depth_holds'], deep)} of {len(deep)}" if deep else "",
        count(lambda row: row["refused"]), f"{sorted(row['seconds'] for row in rows)[len(rows) // 2]:.1f}",
    ]  # fmt: skip
