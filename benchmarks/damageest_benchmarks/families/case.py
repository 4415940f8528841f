"""One draw of a family, from its seed to the judgement, as a row of values that JSON can hold."""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from damageest_evaluate.processes import Row

from damageest.errors import InputError, StageError, describe_error
from damageest.result import Result
from damageest_benchmarks.families.datums import draw_datums
from damageest_benchmarks.families.hands import draw_hand
from damageest_benchmarks.families.scene import Draw
from damageest_benchmarks.families.surroundings import draw_surroundings
from damageest_benchmarks.families.turned import draw_turned
from damageest_benchmarks.families.walls import draw_wall
from damageest_benchmarks.troubles.case import describe_judgement
from damageest_benchmarks.troubles.classify import TrueState, judge, judge_error

FAMILIES: Mapping[str, tuple[int, Callable[[int], Draw]]] = {
    "walls": (300, draw_wall), "hands": (60, draw_hand), "turned": (60, draw_turned), "datums": (40, draw_datums),
    "surroundings": (40, draw_surroundings),
}  # fmt: skip
"""How many draws each family has, and what makes one from its seed."""
NARROW = 0.25
"""An interval that says something ends within this share of the found volume."""


@dataclass(frozen=True)
class FamilyCase:
    """A draw of a family. ``source``: digest of the code."""

    family: str
    seed: int
    source: str = ""
    varied: Mapping[str, float | str] = field(default_factory=dict)

    def compute_key(self) -> str:
        """The case's identifier in a file of rows."""
        return hashlib.sha256(json.dumps([self.family, self.seed, self.source]).encode()).hexdigest()[:16]

    def make_blank_row(self) -> Row:
        """The row of the case without a result."""
        row: Row = {"key": self.compute_key(), "family": self.family, "seed": self.seed, "said": {}, "shown": True}
        row |= {"outcome": "silent", "reason": "", "cautious": False, "refused": False, "accepted": 0, "sites": 0}
        row |= {"true_volume": 0.0, "volume": 0.0, "low": None, "high": None, "holds": False, "comes_out": False}
        return row | {"depth": None, "depth_holds": None, "codes": [], "error": "", "seconds": 0.0}

    def run(self) -> Row:
        """As `run_case`."""
        return run_case(self)


def run_case(case: FamilyCase) -> Row:
    """Runs a draw."""
    return run_draw(FAMILIES[case.family][1](case.seed), case.make_blank_row())


def run_draw(draw: Draw, row: Row) -> Row:
    """The row with what a run makes of a draw. It comes out where the outcome is right, or the volume is inside its
    interval, and the interval of its accepted sites holds the truth and ends within a quarter of what was found. The
    interval of the total also holds what may be lost where nothing was seen, and is not counted here."""
    import damageest

    row = row | {"said": dict(draw.said), "shown": draw.shown}
    row["true_volume"] = draw.damage.volume if draw.damage else 0.0
    job = {"version": 1, "units": "mm", "tolerance": float(f"{draw.tolerance:.6g}"), "allowance": "none"}
    start = time.perf_counter()
    try:
        result = damageest.run(job, part=draw.part, scan=draw.scan, settings=draw.settings)
    except (StageError, InputError) as error:
        message = describe_error(error)
        row["seconds"] = time.perf_counter() - start
        judged = describe_judgement(judge_error(message))
        return row | {name: judged[name] for name in ("outcome", "reason", "refused")} | {"error": message[:300]}
    row["seconds"] = time.perf_counter() - start
    pose = draw.pose if draw.rigid else result.pose.T_part_scan
    judged = describe_judgement(judge(result, TrueState(draw.part, draw.damage, pose, draw.tolerance)))
    row |= {name: judged[name] for name in ("outcome", "reason", "cautious", "refused")}
    return row | _describe(result, draw, row["outcome"])


def _describe(result: Result, draw: Draw, outcome: str) -> Row:
    """The fields of a row that come from the result."""
    taken = [site for site in result.sites if site.accepted]
    truth, volume = (draw.damage.volume if draw.damage else 0.0), sum(site.damage.volume for site in taken)
    ends = [site.volume_95 or (0.0, math.inf) for site in taken]
    low, high = sum(end for end, _ in ends), sum(end for _, end in ends)
    holds = low <= truth <= high
    narrow = low >= (1 - NARROW) * volume and high <= (1 + NARROW) * volume
    depths = [site.depth_95 for site in taken if site.depth_95]
    deep = [lower <= draw.depth <= upper for lower, upper in depths] if math.isfinite(draw.depth) else []
    return {
        "accepted": len(taken), "sites": len(result.sites), "volume": volume,
        "low": low, "high": high if math.isfinite(high) else None, "holds": holds,
        "comes_out": outcome in ("right", "inside") and holds and narrow and bool(taken or not truth),
        "depth": draw.depth if math.isfinite(draw.depth) else None, "depth_holds": any(deep) if deep else None,
        "codes": sorted({reason.code for site in result.sites for reason in site.verdict.reasons}),
    }  # fmt: skip
