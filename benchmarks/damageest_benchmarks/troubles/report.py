"""The counts of right, inside the interval, said, and silent, as tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from damageest_evaluate.processes import Row
from damageest_evaluate.tables import describe_measurement, format_markdown

HEAD = ("kind", "cases", "right", "of these unseen", "inside", "said", "doubtful", "refused", "silent", "held", "s")
LEGEND = (
    "right; inside (a volume is wrong, and the truth lies in its interval); said (what is wrong is doubtful, reported "
    "as lost, or refused); silent (none of these): numbers of cases. of these unseen: right cases with true damage on "
    "skin that the result reports as unseen. doubtful, refused: report of a wrong result. held: groups of accepted "
    "sites whose interval holds the truth, of all. s: median seconds of a run"
)


def make_trouble_cells(rows: Sequence[Row]) -> list[list[str]]:
    """Head and body of the table: a line for each kind, and one for all."""
    done = [row for row in rows if not row["skipped"]]
    kinds = list(dict.fromkeys(row["kind"] for row in done))
    groups = {kind: [row for row in done if row["kind"] == kind] for kind in kinds} | {"all": done}
    return [list(HEAD), *([kind, *_count(group)] for kind, group in groups.items())]


def _count(rows: Sequence[Row]) -> list[str]:
    said = [row for row in rows if row["outcome"] == "said"]
    counts = [
        len(rows),
        sum(row["outcome"] == "right" for row in rows),
        sum(row["outcome"] == "right" and row["unseen"] > 0 for row in rows),
        sum(row["outcome"] == "inside" for row in rows),
        len(said),
        sum(not row["refused"] for row in said),
        sum(row["refused"] for row in said),
        sum(row["outcome"] == "silent" for row in rows),
    ]
    groups = list_groups(rows)
    held = f"{sum(map(is_held, groups))} of {len(groups)}"
    seconds = [row["seconds"] for row in rows if row["seconds"]]
    return [*map(str, counts), held, f"{np.median(seconds):.1f}" if seconds else "–"]


def list_groups(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """The groups of sites and true damage in which a site is accepted."""
    return [group for row in rows for group in row["groups"] if group["accepted"]]


def is_held(group: Mapping[str, Any]) -> bool:
    """Whether the interval of a group holds the truth; an open end holds whatever is larger."""
    high = float("inf") if group["high"] is None else group["high"]
    return bool(group["low"] <= group["truth"] <= high)


def describe_case(row: Row) -> str:
    """The inputs of a case in words."""
    views = f"{row['views']} positions{'' if row['positions'] else ', not given'}" if row["views"] else "all skin"
    amount = f", amount {row['amount']:g}" if row["amount"] else ""
    return f"{row['kind']}: {row['part']}, {row['pose']} pose, {views}{amount}"


def make_command(row: Row) -> str:
    """The command that runs a case alone."""
    return f"damageest evaluate honesty --case {row['number']} --seeds {row['seed']} --points {row['points']}"


def format_trouble_row(row: Row) -> str:
    """The line that is printed when a case is finished."""
    if row["skipped"]:
        return f"{describe_case(row)}: skipped: {row['error']}"
    found = "damage on skin reported as unseen" if row["unseen"] else "no damage, none found"
    reason = row["reason"] or (f"IoU {row['iou']:.3f}" if row["iou"] is not None else found)
    return f"{describe_case(row)}: {row['outcome']}, {row['seconds']:.1f} s: {reason[:300]}"


def list_silent(rows: Sequence[Row]) -> list[str]:
    """A list entry for each case that is wrong and silent, with the command that runs it alone."""
    return [
        f"- {describe_case(row)}: {row['reason'] or row['error'] or 'no result'}. `{make_command(row)}`"
        for row in rows
        if row["outcome"] == "silent" and not row["skipped"]
    ]


def summarise_troubles(rows: Sequence[Row]) -> list[str]:
    """Sentences on the whole: skipped cases, needless doubt, seen skin and cost."""
    done = [row for row in rows if not row["skipped"]]
    lines = []
    if skipped := [row for row in rows if row["skipped"]]:
        lines.append(f"skipped cases: {len(skipped)}; the first: {describe_case(skipped[0])}: {skipped[0]['error']}")
    right = [row for row in done if row["outcome"] == "right"]
    needless = sum(row["cautious"] for row in done)
    share = needless / max(needless + len(right), 1)
    lines.append(f"doubtful, but right if accepted: {needless} cases, {share:.1%} of all that are right")
    likely = [group for group in list_groups(done) if group["levels"] == ["likely"] and group["high"] is not None]
    halves = [(group["high"] - group["low"]) / 2 / group["volume"] for group in likely if group["volume"]]
    if halves:
        lines.append(
            f"half-width of the interval of likely sites: {np.median(halves):.1%} of the volume in the median of "
            f"{len(halves)}"
        )
    partial = [row for row in done if row["seen_error"] is not None and not row["true_volume"]]
    errors = [row["seen_error"] for row in partial if row["views"] and row["kind"].startswith("undamaged")]
    if errors:
        lines.append(
            f"share of seen skin of undamaged parts: off by {np.median(errors):.1f} points of per cent in the median "
            f"of {len(errors)} cases, at most by {max(errors):.1f}"
        )
    if run := [row for row in done if row["cpu_seconds"]]:
        steps = [row["step_seconds"] for row in run]
        total = sum(row["cpu_seconds"] for row in run)
        lines.append(
            f"processor time of the steps between the stages, with all checks: {np.median(steps):.1f} s in the median, "
            f"at most {max(steps):.1f} s, {sum(steps) / total:.0%} of all; time of all runs: "
            f"{sum(row['seconds'] for row in done):.0f} s, on processors {total:.0f} s"
        )
    return lines


def make_trouble_tables(rows: Sequence[Row], command: str, legend: bool = True) -> str:
    """The table, the silent cases and the summary, in Markdown."""
    silent = list_silent(rows)
    text = "; ".join(summarise_troubles(rows))
    parts = [format_markdown(make_trouble_cells(rows)), f"{text[:1].upper()}{text[1:]}."]
    parts.insert(1, "\n".join(["Wrong and silent:", "", *silent]) if silent else "No case is wrong and silent.")
    return "\n\n".join([*([LEGEND + "."] if legend else []), *parts, describe_measurement(f"`{command}`")])
