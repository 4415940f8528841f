"""Figures over rows: over all rows, over the rows of each varied value, and the summary in one sentence."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from damageest_evaluate.processes import Row

RIGHT, WRONG = 0.95, 0.9
"""A case is right if its IoU is at least RIGHT, and wrong if it is below WRONG."""
ENOUGH = 0.95
"""Share of the cases in which damage of a depth has to be found for the depth to count as found."""
CONFIDENCE = 0.95
"""Of the lower bound of the true share."""

Number = float | int | None


def compute_figures(rows: Sequence[Row]) -> dict[str, Number]:
    """Figures of all rows that were not skipped; IoU, errors and distances of the rows with damage; None without data.

    ``right``: share of the cases. ``iou``, ``volume_error``, ``surface_error``, ``distance_median``, ``distance_95``,
    ``pose_error``, ``seconds``, ``start_seconds``: medians. ``worst``: lowest IoU. ``distance_max``, ``seconds_max``,
    ``megabytes``: maxima. ``libigl``: median of a run's processor seconds divided by those of libigl's exact distance
    pass over the same points. All others: counts.
    """
    rows = [row for row in rows if not row["skipped"]]
    damaged = [row for row in rows if row["size"] != 0]
    iou = np.array([row["iou"] for row in rows])
    flagged = np.array([row["flagged"] for row in rows], dtype=bool)
    displaced = [row for row in rows if (row.get("pose_error") or 0) > row["tolerance"]]
    return {
        "cases": len(rows),
        "right": _reduce(rows, "iou", lambda values: np.mean(values >= RIGHT)),
        "iou": _reduce(damaged, "iou", np.median),
        "worst": _reduce(damaged, "iou", np.min),
        "volume_error": _reduce(damaged, "volume_error", lambda values: np.median(np.abs(values))),
        "surface_error": _reduce(damaged, "surface_error", np.median),
        "distance_median": _reduce(damaged, "distance_median", np.median),
        "distance_95": _reduce(damaged, "distance_95", np.median),
        "distance_max": _reduce(damaged, "distance_max", np.max),
        "found": sum(row["found"] for row in rows),
        "missed": sum(row["missed"] for row in rows),
        "false_sites": sum(row["false_sites"] for row in rows),
        "pose_error": _reduce(rows, "pose_error", np.median),
        "pose_lost": len(displaced),
        "wrong": int((iou < WRONG).sum()),
        "wrong_flagged": int(((iou < WRONG) & flagged).sum()),
        "right_flagged": int(((iou >= RIGHT) & flagged).sum()),
        "errors": sum(bool(row["error"]) for row in rows),
        "seconds": _reduce(rows, "seconds", np.median),
        "seconds_max": _reduce(rows, "seconds", np.max),
        "libigl": _median_ratio(rows, "cpu_seconds", "libigl_seconds"),
        "start_seconds": _reduce(rows, "start_seconds", np.median),
        "megabytes": _reduce(rows, "megabytes", np.max),
    }


def _reduce(rows: Sequence[Row], name: str, of: Callable[[Any], Any]) -> float | None:
    values = [row[name] for row in rows if row.get(name) is not None]
    return float(of(np.array(values))) if values else None


def _median_ratio(rows: Sequence[Row], over: str, under: str) -> float | None:
    known = [row[over] / row[under] for row in rows if row.get(over) is not None and row.get(under)]
    return float(np.median(known)) if known else None


def compute_stage_costs(rows: Sequence[Row]) -> dict[str, tuple[float, float]]:
    """For each stage, in the order of the route: median seconds, and the peak memory in MB."""
    known = [row for row in rows if row.get("stage_seconds")]
    names = dict.fromkeys(name for row in known for name in row["stage_seconds"])
    return {
        name: (
            float(np.median([row["stage_seconds"].get(name, 0.0) for row in known])),
            max(row["stage_megabytes"].get(name, 0.0) for row in known),
        )
        for name in names
    }


def collect_axes(rows: Sequence[Row]) -> dict[str, list[Any]]:
    """The names of all that was varied, each with its values in the order of the rows."""
    axes: dict[str, list[Any]] = {}
    for row in rows:
        for name, label in row["varied"].items():
            if label not in axes.setdefault(name, []):
                axes[name].append(label)
    return axes


def make_title(axis: str, rows: Sequence[Row], unit: str) -> str:
    """The table head or axis label for the values of ``axis``."""
    if axis not in ("noise", "tolerance"):
        return f"depth, {unit}" if axis == "size" else axis
    # for parts of different size, the values are multiples
    in_unit = all(row["varied"][axis] in ("auto", row[axis]) for row in rows)
    return f"{axis}, {unit}" if in_unit else f"{axis}, times the {'default' if axis == 'noise' else 'noise'}"


def format_label(value: Any) -> str:
    """A value of an axis, as text."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def group_by(rows: Sequence[Row], axis: str) -> dict[Any, list[Row]]:
    """The rows of each value of an axis. The name of the part is also an axis: ``part``."""
    if axis == "part":
        return {name: [row for row in rows if row["part"] == name] for name in dict.fromkeys(r["part"] for r in rows)}
    return {value: [row for row in rows if row["varied"].get(axis) == value] for value in collect_axes(rows)[axis]}


def group_by_combination(rows: Sequence[Row]) -> dict[tuple[Any, ...], list[Row]]:
    """The rows of each combination of what was varied."""
    axes = collect_axes(rows)
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row["varied"].get(axis, "") for axis in axes), []).append(row)
    order = {axis: {value: k for k, value in enumerate(values)} for axis, values in axes.items()}
    return dict(
        sorted(groups.items(), key=lambda item: [order[a].get(v, -1) for a, v in zip(axes, item[0], strict=True)])
    )


def summarise(rows: Sequence[Row], unit: str) -> str:
    """The least depth from which damage was found in 95 % of the cases; if depth was not varied, the number found."""
    rows = [row for row in rows if not row["skipped"]]
    intact = [row for row in rows if row["size"] == 0]
    alarms = sum(row["sites"] > 0 for row in intact)
    scans = _format_count(len(intact), "scan")
    also = f"; on {alarms} of {scans} of the intact part, damage was reported" if intact else ""
    rows = [row for row in rows if row["size"] != 0]
    if not rows:
        return f"No case had damage{also}." if intact else "There was no case."
    if any(row["size"] is None for row in rows):
        text = f"All damage was found in {sum(_is_found(row) for row in rows)} of {_format_count(len(rows), 'case')}"
        return f"{text}; no false site was reported in {sum(not row['false_sites'] for row in rows)}{also}."
    groups: dict[str, list[Row]] = {}
    for row in rows:
        others = [f"{axis} {format_label(value)}" for axis, value in row["varied"].items() if axis != "size"]
        groups.setdefault(", ".join(others), []).append(row)
    share = f"at least {_format_percent(ENOUGH)} of the cases"
    if len(groups) > 1:
        each = [f"{_describe_least_depth(group, unit)} with {others}" for others, group in groups.items()]
        return f"Damage was found in {share}: {'; '.join(each)}{also}."
    size, hits, cases, deepest = _find_least_depth(rows)
    if size is None:
        at = f"{hits} of {cases} at {format_label(deepest)} {unit}, the deepest"
        return f"Damage of no depth was found in {share} ({at}){also}."
    deeper = " or more" if size < max(row["size"] for row in rows) else ""
    bound = _format_percent(lower_confidence_bound(hits, cases))
    return (
        f"Damage with a depth of {format_label(size)} {unit}{deeper} was found in {share} ({hits} of {cases}; with "
        f"{_format_percent(CONFIDENCE)} confidence the true share is above {bound}){also}."
    )


def _describe_least_depth(rows: Sequence[Row], unit: str) -> str:
    size, hits, cases, deepest = _find_least_depth(rows)
    if size is None:
        return f"at no depth ({hits} of {cases} at {format_label(deepest)} {unit}, the deepest)"
    return f"from a depth of {format_label(size)} {unit} ({hits} of {cases})"


def _find_least_depth(rows: Sequence[Row]) -> tuple[float | None, int, int, float]:
    """(depth, found, cases, at): the least depth from which all depths were found in ENOUGH of their cases, or None.

    ``found`` of ``cases`` were found at the depth ``at``: the least depth, or if there is none, the deepest.
    """
    hits: dict[float, list[bool]] = {}
    for row in sorted(rows, key=lambda row: -float(row["size"])):
        hits.setdefault(row["size"], []).append(_is_found(row))
    sizes = list(hits)
    below = next((k for k, size in enumerate(sizes) if np.mean(hits[size]) < ENOUGH), len(sizes))
    depth = sizes[max(below - 1, 0)]
    return depth if below else None, sum(hits[depth]), len(hits[depth]), depth


def lower_confidence_bound(hits: int, cases: int) -> float:
    """The value that the true share exceeds with CONFIDENCE, given ``hits`` of ``cases`` (Clopper and Pearson 1934)."""
    from scipy.stats import beta

    return float(beta.ppf(1 - CONFIDENCE, hits, cases - hits + 1)) if hits else 0.0


def _is_found(row: Row) -> bool:
    return bool(row["found"] and not row["missed"])


def _format_percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def _format_count(count: int, what: str) -> str:
    return f"{count} {what}" + ("s" if count != 1 else "")
