"""The row of a job: its result, or why it has none."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Any

from damageest.artefacts import Reason
from damageest.findings import Interval, describe_interval
from damageest.result import Result

OUTCOMES = {
    "ok": "ran",
    "incomplete": "ran, but a stage failed on a site",
    "failed": "a stage failed or refused",
    "refused": "job or input not valid",
    "crashed": "its process ended",
    "memory": "exceeded its memory limit",
    "timeout": "exceeded its time limit",
    "lost": "two workers died with it, or the cluster ended",
}
LEVELS = ("proven", "likely", "doubtful")


@dataclass(frozen=True)
class Row:
    """One job of a batch. ``outcome``: a key of `OUTCOMES`. ``verdicts``: number of sites by verdict. ``warnings``:
    their number. ``reasons``: the codes of the reasons for its verdicts with their amounts, as "1: form ±3.2 mm³", and
    ``remedies``: what to do. Volumes are in ``units`` cubed, ``volume_95`` the 95 % interval, its high end None where
    nothing limits it. ``seconds`` from start to end,
    ``megabytes`` the peak of the job's process, ``tries``: how many workers the job was given to. ``key`` tells
    whether job, inputs and code are the same in another run of the batch."""

    name: str
    job: str
    output: str
    outcome: str
    settings: tuple[str, ...] = ()
    error: str = ""
    sites: int = 0
    verdicts: dict[str, int] = field(default_factory=dict)
    damage_volume: float | None = None
    volume_95: tuple[float, float | None] | None = None
    part_volume: float | None = None
    units: str = ""
    tolerance: float | None = None
    warnings: int = 0
    reasons: tuple[str, ...] = ()
    remedies: tuple[str, ...] = ()
    seconds: float = 0.0
    megabytes: float | None = None
    tries: int = 1
    host: str = ""
    key: str = ""

    @property
    def ran(self) -> bool:
        """Whether the job ran to its end, whatever the verdicts."""
        return self.outcome == "ok"

    @property
    def has_result(self) -> bool:
        return self.outcome in ("ok", "incomplete")

    @property
    def verdict(self) -> str:
        """The verdicts as text."""
        if not self.has_result:
            return ""
        counts = [f"{self.verdicts[level]} {level}" for level in LEVELS if self.verdicts.get(level)]
        return ", ".join(counts) or "no damage found"

    def to_values(self) -> dict[str, Any]:
        """The row as JSON can hold it."""
        return dataclasses.asdict(self)


def read_row(values: dict[str, Any]) -> Row:
    """The row of `Row.to_values`. Raises TypeError or ValueError for anything else."""
    interval = values.get("volume_95")
    lists = ("settings", "reasons", "remedies")
    changed = {name: tuple(values[name]) for name in lists if name in values} | {
        "volume_95": None if interval is None else tuple(interval)
    }
    return Row(**{**values, **changed})


def describe_result(result: Result) -> dict[str, Any]:
    """The fields of a row that come from a result."""
    levels = [site.verdict.level for site in result.sites]
    told = [(site.id, reason) for site in result.sites for reason in site.verdict.reasons]
    return {
        "outcome": result.status,
        "error": "; ".join(" ".join(text.split()) for text in result.failures),
        "sites": len(result.sites),
        "verdicts": {level: levels.count(level) for level in LEVELS if level in levels},
        "damage_volume": result.damage_volume,
        "volume_95": _close_interval(result.volume_95),
        "part_volume": result.part.volume,
        "units": result.units,
        "tolerance": result.tolerance,
        "warnings": len(result.warnings) + sum(len(site.warnings) for site in result.sites),
        "reasons": tuple(f"{number}: {_show_reason(reason)}" for number, reason in told),
        "remedies": tuple(dict.fromkeys(reason.remedy for _, reason in told if reason.remedy)),
    }


def _close_interval(interval: Interval | None) -> tuple[float, float | None] | None:
    """The interval with None for an open end, which JSON can hold."""
    return None if interval is None else (interval[0], interval[1] if math.isfinite(interval[1]) else None)


def show_interval(interval: tuple[float, float | None]) -> str:
    """The interval of a row as text."""
    low, high = interval
    return describe_interval((low, math.inf if high is None else high))


def _show_reason(reason: Reason) -> str:
    """Code and amount of a reason."""
    amount = "" if reason.amount is None else f" {reason.amount:.3g} {reason.unit}".rstrip()
    return f"{reason.code}{amount}"
