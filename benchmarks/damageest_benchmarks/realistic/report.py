"""The table of the suite of realistic scans, and what went wrong in which case."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from damageest_evaluate.processes import Row
from damageest_evaluate.tables import describe_measurement, format_markdown

from damageest_benchmarks.troubles.report import is_held, list_groups

HEAD = (
    "sensor", "cases", "right", "inside", "doubted", "refused", "silent", "held", "pose, steps", "pose within 1",
    "undamaged", "no site", "false", "notes", "notes, most", "time, times", "time, most",
)  # fmt: skip
LEGEND = (
    "right, inside, silent: as in the suite of honesty; doubted, refused: report of a wrong result. held: groups of "
    "accepted sites whose interval holds the truth, of all. pose: error in resolutions of the sensor (standard "
    "deviation of one point), median, and within one of them, of all runs with a result. undamaged: cases without a "
    "loss; no site: those without any site; false: those with an accepted one. notes: of a run, also those that it "
    "does not print, median and most. time: processor time in multiples of a clean scan's of the same part with as "
    "many points, median and most"
)
MOST_NOTES = 8
MOST_TIME = 2.0
"""What a run may have: lines of notes, and times the processor time of a clean scan."""


def make_realistic_table(rows: Sequence[Row]) -> str:
    """A table in Markdown with a line for each sensor, and one for all."""
    done = [row for row in rows if not row["skipped"]]
    groups = {name: [row for row in done if row["sensor"] == name] for name in dict.fromkeys(r["sensor"] for r in done)}
    return format_markdown([list(HEAD), *([name, *_count(group)] for name, group in [*groups.items(), ("all", done)])])


def _count(rows: Sequence[Row]) -> list[str]:
    outcomes = [row["outcome"] for row in rows]
    said = [row for row in rows if row["outcome"] == "said"]
    taken = list_groups(rows)
    steps = [row["pose_error"] / row["resolution"] for row in rows if row["pose_error"] is not None]
    whole = [row for row in rows if not row["damaged"]]
    quiet = sum(not row["sites"] and not row["refused"] and not row["error"] for row in whole)
    notes = [len(row["notes"]) for row in rows if not row["error"]]
    times = [_measure_time(row) for row in rows if row["clean_seconds"]]
    return [
        str(len(rows)),
        str(outcomes.count("right")),
        str(outcomes.count("inside")),
        str(sum(not row["refused"] for row in said)),
        str(sum(row["refused"] for row in said)),
        str(outcomes.count("silent")),
        f"{sum(map(is_held, taken))} of {len(taken)}",
        _tell(steps, "{:.2f}"),
        f"{sum(value <= 1 for value in steps)} of {len(steps)}",
        str(len(whole)),
        str(quiet),
        str(sum(row["accepted"] > 0 for row in whole)),
        _tell(notes, "{:.0f}"),
        str(max(notes, default=0)),
        _tell(times, "{:.1f}"),
        f"{max(times, default=0.0):.1f}",
    ]


def _tell(values: Sequence[float], form: str) -> str:
    return form.format(float(np.median(values))) if values else "–"


def _measure_time(row: Row) -> float:
    return float(row["cpu_seconds"] / row["clean_seconds"])


def describe_case(row: Row) -> str:
    """The inputs of a case in words."""
    views = f"{row['views']} views" if row["views"] > 1 else "1 view" if row["views"] else "all skin"
    return f"{row['sensor']}: {row['part']}, {views}, {'a loss' if row['damaged'] else 'no loss'}"


def format_realistic_row(row: Row) -> str:
    """The line that is printed when a case is finished."""
    head = f"{row['number']} {describe_case(row)}"
    if row["skipped"] or (row["error"] and not row["refused"]):
        return f"{head}: {'skipped' if row['skipped'] else 'no result'}: {row['error']}"
    return f"{head}: {row['outcome']}: {_describe_outcome(row)}"


def _describe_outcome(row: Row) -> str:
    words = [row["reason"][:300]] if row["reason"] else []
    if row["pose_error"] is not None:
        words.append(f"pose off by {row['pose_error'] / row['resolution']:.2f} steps")
        words.append(f"tolerance {row['tolerance'] / row['resolution']:.1f} steps")
        words.append(f"{row['accepted']} of {row['sites']} sites accepted, {row['found']:.4g} of {row['true']:.4g} mm³")
        words.append(f"{len(row['notes'])} notes")
    if row["clean_seconds"]:
        words.append(f"{row['cpu_seconds']:.0f} s, {_measure_time(row):.1f} times a clean scan's")
    return "; ".join(words)


def list_faults(rows: Sequence[Row]) -> list[str]:
    """A list entry for each case that falls short of what is wanted: what, and the command that runs it alone."""
    return [
        f"- {describe_case(row)}: {', '.join(faults)}. `damageest evaluate realistic --case {row['number']}`"
        for row in rows
        if not row["skipped"] and (faults := find_faults(row))
    ]


def find_faults(row: Row) -> list[str]:
    """What a case lacks."""
    found: list[Any] = [f"{row['outcome']} ({row['reason'] or row['error']})"] if row["outcome"] != "right" else []
    if not row["damaged"] and row["sites"]:
        found.append(f"{row['sites']} sites without a loss, {row['accepted']} accepted")
    if row["pose_error"] is not None and row["pose_error"] > row["resolution"]:
        found.append(f"pose off by {row['pose_error'] / row['resolution']:.1f} steps")
    if len(row["notes"]) > MOST_NOTES:
        found.append(f"{len(row['notes'])} notes")
    if row["clean_seconds"] and _measure_time(row) > MOST_TIME:
        found.append(f"{_measure_time(row):.1f} times the time of a clean scan")
    return [str(text)[:240] for text in found]


def make_realistic_report(rows: Sequence[Row], command: str, legend: bool = True) -> str:
    """The table, what is short of what is wanted, and how it was measured, in Markdown."""
    faults = list_faults(rows)
    skipped = [f"- {describe_case(row)}: {row['error']}" for row in rows if row["skipped"]]
    parts = [f"{LEGEND}."] if legend else []
    parts.append(make_realistic_table(rows))
    if faults:
        parts.append("\n".join(["Cases that fall short:", "", *faults]))
    if skipped:
        parts.append("\n".join(["Skipped:", "", *skipped]))
    return "\n\n".join([*parts, describe_measurement(f"`{command}`")])
