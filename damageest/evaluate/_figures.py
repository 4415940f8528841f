"""Figures over rows: one set for all of them, one for each value of what was varied, and the sentence that says it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from damageest.evaluate._run import Row

RIGHT, WRONG = 0.95, 0.9
"""IoU from which a case is right, and below which it is wrong."""
ENOUGH = 0.95
"""Share of the cases in which a damage has to be found."""
CONFIDENCE = 0.95

Number = float | int | None


def figures(rows: Sequence[Row]) -> dict[str, Number]:
    """Of the rows that are cases. IoU, errors and distances: of those with damage. None where there is nothing to say.

    ``right``: share of the cases; ``volume_error``, ``surface_error``, ``distance_95``, ``pose_error``, ``seconds``:
    medians; ``distance_max``, ``seconds_max``, ``megabytes``: the largest; ``libigl``: median of processor seconds over
    those of libigl's exact distance from all points; the others: how many.
    """
    rows = [row for row in rows if not row["skipped"]]
    damaged = [row for row in rows if row["size"] != 0]
    iou = np.array([row["iou"] for row in rows])
    flagged = np.array([row["flagged"] for row in rows], dtype=bool)
    lost = [row for row in rows if (row.get("pose_error") or 0) > row["tolerance"]]
    return {
        "cases": len(rows),
        "right": _of(rows, "iou", lambda values: np.mean(values >= RIGHT)),
        "iou": _of(damaged, "iou", np.median),
        "worst": _of(damaged, "iou", np.min),
        "volume_error": _of(damaged, "volume_error", lambda values: np.median(np.abs(values))),
        "surface_error": _of(damaged, "surface_error", np.median),
        "distance_median": _of(damaged, "distance_median", np.median),
        "distance_95": _of(damaged, "distance_95", np.median),
        "distance_max": _of(damaged, "distance_max", np.max),
        "found": sum(row["found"] for row in rows),
        "missed": sum(row["missed"] for row in rows),
        "invented": sum(row["invented"] for row in rows),
        "pose_error": _of(rows, "pose_error", np.median),
        "pose_lost": len(lost),
        "wrong": int((iou < WRONG).sum()),
        "wrong_flagged": int(((iou < WRONG) & flagged).sum()),
        "right_flagged": int(((iou >= RIGHT) & flagged).sum()),
        "errors": sum(bool(row["error"]) for row in rows),
        "seconds": _of(rows, "seconds", np.median),
        "seconds_max": _of(rows, "seconds", np.max),
        "libigl": _ratio(rows, "cpu_seconds", "libigl_seconds"),
        "start_seconds": _of(rows, "start_seconds", np.median),
        "megabytes": _of(rows, "megabytes", np.max),
    }


def _of(rows: Sequence[Row], name: str, of: Callable[[Any], Any]) -> float | None:
    known = [row[name] for row in rows if row.get(name) is not None]
    return float(of(np.array(known))) if known else None


def _ratio(rows: Sequence[Row], over: str, under: str) -> float | None:
    known = [row[over] / row[under] for row in rows if row.get(over) is not None and row.get(under)]
    return float(np.median(known)) if known else None


def stages(rows: Sequence[Row]) -> dict[str, tuple[float, float]]:
    """Of each stage, in the order of the route: median seconds, and the peak memory in MB while it ran."""
    known = [row for row in rows if row.get("stage_seconds")]
    names = dict.fromkeys(name for row in known for name in row["stage_seconds"])
    return {
        name: (
            float(np.median([row["stage_seconds"].get(name, 0.0) for row in known])),
            max(row["stage_megabytes"].get(name, 0.0) for row in known),
        )
        for name in names
    }


def axes_of(rows: Sequence[Row]) -> dict[str, list[Any]]:
    """What was varied, and its values in their order."""
    axes: dict[str, list[Any]] = {}
    for row in rows:
        for name, label in row["varied"].items():
            if label not in axes.setdefault(name, []):
                axes[name].append(label)
    return axes


def title(axis: str, rows: Sequence[Row], unit: str) -> str:
    """What heads the values of an axis."""
    if axis not in ("noise", "tolerance"):
        return f"depth, {unit}" if axis == "size" else axis
    # a multiple where the parts differ in size
    own = all(row["varied"][axis] in ("auto", row[axis]) for row in rows)
    return f"{axis}, {unit}" if own else f"{axis}, times the {'usual' if axis == 'noise' else 'noise'}"


def label(value: Any) -> str:
    """A value of an axis as text."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def by(rows: Sequence[Row], axis: str) -> dict[Any, list[Row]]:
    """The rows of each value of an axis; ``part`` is one as well."""
    if axis == "part":
        return {name: [row for row in rows if row["part"] == name] for name in dict.fromkeys(r["part"] for r in rows)}
    return {label: [row for row in rows if row["varied"].get(axis) == label] for label in axes_of(rows)[axis]}


def crossed(rows: Sequence[Row]) -> dict[tuple[Any, ...], list[Row]]:
    """The rows of each combination of what was varied."""
    axes = axes_of(rows)
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row["varied"].get(axis, "") for axis in axes), []).append(row)
    order = {axis: {value: k for k, value in enumerate(values)} for axis, values in axes.items()}
    return dict(
        sorted(groups.items(), key=lambda item: [order[a].get(v, -1) for a, v in zip(axes, item[0], strict=True)])
    )


def sentence(rows: Sequence[Row], unit: str) -> str:
    """From which depth on damage was found in 95 % of the cases; where depth was not varied, how much was found."""
    rows = [row for row in rows if not row["skipped"]]
    sound = [row for row in rows if row["size"] == 0]
    alarms = sum(row["sites"] > 0 for row in sound)
    also = f"; on {alarms} of {_many(len(sound), 'scan')} of the sound part it saw damage" if sound else ""
    rows = [row for row in rows if row["size"] != 0]
    if not rows:
        return f"Damage was looked for{also}." if sound else "There was no case."
    if any(row["size"] is None for row in rows):
        text = f"All damage was found in {sum(_found(row) for row in rows)} of {_many(len(rows), 'case')}"
        return f"{text}, and nothing else in {sum(not row['invented'] for row in rows)}{also}."
    groups: dict[str, list[Row]] = {}
    for row in rows:
        others = [f"{axis} {label(value)}" for axis, value in row["varied"].items() if axis != "size"]
        groups.setdefault(", ".join(others), []).append(row)
    share = f"at least {_percent(ENOUGH)} of the cases"
    if len(groups) > 1:
        each = [f"{_from(group, unit)} with {others}" for others, group in groups.items()]
        return f"Found in {share} was damage {'; '.join(each)}{also}."
    size, hits, cases, least = _least(rows)
    if size is None:
        return f"No depth was found in {share} ({hits} of {cases} at {label(least)} {unit}, the deepest tried){also}."
    deeper = " or more" if size < max(row["size"] for row in rows) else ""
    return (
        f"Damage {label(size)} {unit} deep{deeper} was found in {share} ({hits} of {cases}; with "
        f"{_percent(CONFIDENCE)} confidence the true share is above {_percent(surely(hits, cases))}){also}."
    )


def _from(rows: Sequence[Row], unit: str) -> str:
    size, hits, cases, least = _least(rows)
    if size is None:
        return f"of no depth ({hits} of {cases} at {label(least)} {unit})"
    return f"from {label(size)} {unit} deep ({hits} of {cases})"


def _least(rows: Sequence[Row]) -> tuple[float | None, int, int, float]:
    """The least depth from which on all depths were found often enough, None for none; how many cases of how many were
    found there, else at the deepest; and that depth."""
    hits: dict[float, list[bool]] = {}
    for row in sorted(rows, key=lambda row: -float(row["size"])):
        hits.setdefault(row["size"], []).append(_found(row))
    sizes = list(hits)
    below = next((k for k, size in enumerate(sizes) if np.mean(hits[size]) < ENOUGH), len(sizes))
    place = sizes[max(below - 1, 0)]
    return place if below else None, sum(hits[place]), len(hits[place]), place


def surely(hits: int, cases: int) -> float:
    """The share that the true one exceeds with the confidence, by Clopper and Pearson."""
    from scipy.stats import beta

    return float(beta.ppf(1 - CONFIDENCE, hits, cases - hits + 1)) if hits else 0.0


def _found(row: Row) -> bool:
    return bool(row["found"] and not row["missed"])


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def _many(count: int, what: str) -> str:
    return f"{count} {what}" + ("s" if count != 1 else "")
