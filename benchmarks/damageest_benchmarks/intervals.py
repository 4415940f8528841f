"""How often the truth lies in the 95 % intervals, over random damages at three levels of noise and three densities."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from damageest_evaluate.case import DamageCase, simulate_scan
from damageest_evaluate.damages import KINDS
from damageest_evaluate.job import fingerprint_code
from damageest_evaluate.processes import Row
from damageest_evaluate.tables import describe_measurement, format_markdown

from damageest.artefacts import Scan
from damageest.errors import DamageestError, InputError, describe_error, suggest
from damageest.findings import Interval
from damageest.geometry.lost_depth import measure_lost_depth
from damageest.io.digests import digest
from damageest.registry import Registry
from damageest.result import Result
from damageest_benchmarks.parts import PARTS

NOISES = (0.00025, 0.0005, 0.001)
"""Noise of the scan, as shares of the part's diagonal. The tolerance is four times the noise."""
POINTS = (30_000, 55_000, 100_000)
"""Points of the scan."""
DENSITY = 0.4
"""Unevenness of the scan's density: the option `density` of `scan: simulate`."""
UNKNOWN_POSE = 4
"""The pose is unknown in one case of so many."""


@dataclass(frozen=True)
class IntervalCase(DamageCase):
    """A case whose row says whether the truth lies in the intervals."""

    def make_blank_row(self) -> Row:
        """The row of a case that has no result yet."""
        row: Row = {"key": self.compute_key(), "part": self.part, "seed": self.seed, "varied": dict(self.varied)}
        row |= {"kinds": [], "true_volume": 0.0, "volume": 0.0, "volume_95": None, "true_depth": 0.0}
        return row | {"depth_95": None, "doubtful": 0, "sites": 0, "error": "", "skipped": False, "seconds": 0.0}

    def run(self) -> dict[str, Any]:
        """As `run_interval_case`."""
        return run_interval_case(self)


def make_interval_cases(count: int, seed: int, parts: Sequence[str], registry: Registry) -> list[IntervalCase]:
    """``count`` cases: parts, kinds of the first damage, noises and densities in turn. Raises InputError."""
    for name in parts:
        if name not in PARTS:
            raise InputError(f"--parts: there is no part '{name}'{suggest(name, list(PARTS))}")
    if count < 1:
        raise InputError(f"--cases: {count} is too few; at least 1 is needed")
    made = {name: PARTS[name]() for name in dict.fromkeys(parts)}
    code, kinds, cases = fingerprint_code(registry), tuple(KINDS), []
    for number in range(count):
        name = parts[number % len(parts)]
        share, points = NOISES[number % 3], POINTS[number // 3 % 3]
        noise = float(f"{share * made[name].diagonal:.6g}")
        is_known = number % UNKNOWN_POSE != UNKNOWN_POSE - 1
        pose = "identity" if is_known else "random"
        cases.append(
            IntervalCase(
                part=name,
                seed=1000 * seed + number,
                first=kinds[(number + number // len(parts)) % len(kinds)],
                tolerance=4 * noise,
                scanner={"points": points, "noise": noise, "density": DENSITY, "pose": pose},
                settings=["allowance=none", *(["align=none"] if is_known else [])],
                varied={"noise": share, "points": points, "pose": "known" if is_known else "unknown"},
                source=digest(code, made[name].vertices, made[name].faces),
            )
        )
    return cases


def run_interval_case(case: IntervalCase) -> Row:
    """Runs a case and gives its row. If the run fails, ``error`` says why; ``skipped``: no damage fits the part."""
    import damageest

    part, row = case.load_part(), case.make_blank_row()
    try:
        scan, kinds = simulate_scan(case, part)
    except (LookupError, DamageestError) as error:
        return row | {"error": describe_error(error), "skipped": True}
    truth = scan.truth.damage if scan.truth else None
    assert truth is not None
    row |= {"kinds": list(kinds), "true_volume": truth.volume, "true_depth": measure_lost_depth(truth, part)}
    start = time.perf_counter()
    try:
        job = {"version": 1, "tolerance": case.tolerance}
        blind = Scan(scan.points, unit=scan.unit)  # without the truth
        result = damageest.run(job, part=part, scan=blind, settings=list(case.settings))
    except DamageestError as error:
        return row | {"error": describe_error(error), "seconds": time.perf_counter() - start}
    return row | {
        "seconds": time.perf_counter() - start,
        "volume": result.damage_volume,
        "volume_95": result.volume_95,
        "depth_95": _find_deepest(result),
        "sites": len(result.sites),
        "doubtful": sum(site.verdict.level == "doubtful" for site in result.sites),
    }


def _find_deepest(result: Result) -> Interval | None:
    """The interval of the largest depth of all sites; None where one of them has none."""
    found = [site.depth_95 for site in result.sites if site.accepted]
    known = [one for one in found if one is not None]
    if not known or len(known) < len(found):
        return None
    return max(low for low, _ in known), max(high for _, high in known)


def format_interval_row(row: Row) -> str:
    """The line that is printed when a case is finished."""
    what = f"{row['part']} {row['seed']} {'+'.join(row['kinds'])}"
    if row["error"]:
        return f"{what}: {'skipped: ' if row['skipped'] else ''}{row['error'][:200]}"
    if row["volume_95"] is None:
        return f"{what}: no interval; {row['seconds']:.1f} s"
    words = [f"volume {row['volume'] / row['true_volume'] - 1:+.2%} off, half-width {_half_width(row, 'volume'):.2%}"]
    words += [f"{name}: truth outside" for name in ("volume", "depth") if not _is_inside(row, name)]
    return f"{what}: {', '.join(words)}; {row['seconds']:.1f} s"


def make_interval_tables(rows: Sequence[Row], command: str) -> str:
    """The table in Markdown, with a line for each noise, density and kind of pose, and what it says in words."""
    head = ["", "cases", "volume: inside", "half-width", "depth: inside", "half-width", "no interval"]
    groups: list[tuple[str, list[Row]]] = []
    for axis, words in (("noise", "noise {:g} of the diagonal"), ("points", "{:d} points"), ("pose", "pose {}")):
        for value in dict.fromkeys(row["varied"][axis] for row in sorted(rows, key=lambda row: row["varied"][axis])):
            groups.append((words.format(value), [row for row in rows if row["varied"][axis] == value]))
    groups.append(("all", list(rows)))
    body = [[name, *_count(group)] for name, group in groups]
    skipped = sum(row["skipped"] for row in rows)
    notes = [f"Skipped, since no damage fits the part: {skipped}."] if skipped else []
    return "\n\n".join([format_markdown([head, *body]), *notes, describe_measurement(f"`{command}`")])


def _count(rows: Sequence[Row]) -> list[str]:
    """The figures of a group of rows. An interval is missing where the result has none, or the run failed."""
    asked = [row for row in rows if not row["skipped"]]
    known = [row for row in asked if row["volume_95"] is not None]
    words = [str(len(asked))]
    for name in ("volume", "depth"):
        given = [row for row in known if row[f"{name}_95"] is not None]
        if not given:
            words += ["–", "–"]
            continue
        share = float(np.mean([_is_inside(row, name) for row in given]))
        error = np.sqrt(max(share * (1 - share), 1 / (4 * len(given))) / len(given))
        width = float(np.median([_half_width(row, name) for row in given]))
        words += [f"{share:.1%} ± {error:.1%}", f"{width:.2%}"]
    return [*words, str(len(asked) - len(known))]


def _is_inside(row: Row, name: str) -> bool:
    interval = row[f"{name}_95"]
    return interval is not None and bool(interval[0] <= row[f"true_{name}"] <= interval[1])


def _half_width(row: Row, name: str) -> float:
    low, high = row[f"{name}_95"]
    return float((high - low) / 2 / row[f"true_{name}"])
