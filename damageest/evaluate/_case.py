"""One case of the suite, from the random damage to its score, as a row that JSON can hold."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

from damageest.artefacts import Part, Scan, Solid
from damageest.errors import DamageestError, StageError
from damageest.evaluate.damages import KINDS, random_damage
from damageest.evaluate.parts import PARTS
from damageest.evaluate.scores import score
from damageest.stages.scan.simulate import Simulate

SIGMA = 0.0005
"""Noise of the scan as a share of the part's diagonal."""


@dataclass(frozen=True)
class Case:
    """What makes a case; equal cases give equal scans. ``tolerance`` is ``auto`` or the noise's multiple; ``settings``
    are ``stage.option=value`` for the job."""

    number: int
    part: str
    seed: int
    pose: str = "random"
    method: str = "auto"
    points: int = 150_000
    density: float = 0.4
    undamaged: bool = False
    tolerance: str = "4"
    settings: tuple[str, ...] = ()

    def key(self) -> str:
        """Names the case among the rows of a file."""
        return "|".join(str(value) for value in {**vars(self), "settings": " ".join(self.settings)}.values())


def cases(
    count: int,
    seed: int,
    parts: list[str],
    pose: str,
    method: str,
    undamaged: bool,
    points: int,
    tolerance: str,
    settings: tuple[str, ...] = (),
) -> list[Case]:
    """``count`` cases that go through the parts in turn."""
    return [
        Case(k, parts[k % len(parts)], 1000 * seed + k, pose, method, points, 0.4, undamaged, tolerance, settings)
        for k in range(count)
    ]


def scanned(case: Case) -> tuple[Part, Scan, tuple[str, ...]]:
    """The part, its scan with the truth, and the kinds of the damage."""
    part = PARTS[case.part]()
    tools: tuple[Any, ...] = ()
    kinds: tuple[str, ...] = ()
    if not case.undamaged:
        # the first loss goes through the kinds in turn, shifted for each round of the parts
        first = list(KINDS)[(case.number + case.number // len(PARTS)) % len(KINDS)]
        made = random_damage(part, case.seed, (first,))
        tools, kinds = made.tools, made.kinds
    options: dict[str, Any] = {"points": case.points, "density": case.density, "pose": case.pose, "seed": case.seed}
    scan = Simulate(damage=tools, noise=SIGMA * part.diagonal, **options).run("mm", part)
    return part, scan, kinds


def run_case(case: Case) -> dict[str, Any]:
    """The row of a case: its score and what the result said of itself; ``error`` where there is no result."""
    part, scan, kinds = scanned(case)
    truth = scan.truth
    assert truth is not None
    sigma = SIGMA * part.diagonal
    share = truth.damage.volume / part.volume if truth.damage else 0.0
    row: dict[str, Any] = {"key": case.key(), "part": case.part, "seed": case.seed, "kinds": list(kinds)}
    row |= {"share": share, "error": "", "iou": 0.0, "flagged": False, "sites": 0}
    start = time.perf_counter()
    try:
        found = _run(part, scan, case, 4 * sigma)
    except DamageestError as error:
        # a stage that refuses owns up to it; a job or an input at fault would be the suite's own mistake
        text, refused = str(error).replace("\n", " "), isinstance(error, StageError)
        return row | {"error": text, "flagged": refused, "seconds": time.perf_counter() - start}
    row["seconds"] = time.perf_counter() - start
    solids: list[Solid] = [site.damage for site in found.sites]
    marks = score(part, solids, truth.damage, found.tolerance, found.pose.T_part_scan, truth.T_part_scan)
    row |= {
        "iou": marks.iou,
        "volume_error": marks.volume_error,
        "surface_error": marks.surface_error,
        "pose_error": marks.pose_error / sigma,
        "sites": len(found.sites),
        "methods": sorted({site.method for site in found.sites}),
        "consistent": all(site.evidence.consistent for site in found.sites),
        "failures": list(found.failures),
        "reasons": [reason for site in found.sites for reason in site.evidence.reasons],
        "watertight": all(isinstance(solid, Solid) for solid in solids),
    }
    row["flagged"] = not row["consistent"] or found.status != "ok"
    return {name: None if isinstance(v, float) and math.isnan(v) else v for name, v in row.items()}


def _run(part: Part, scan: Scan, case: Case, tolerance: float) -> Any:
    """The public way in; scan made before, so that its time does not count."""
    import damageest

    wanted: Any = "auto" if case.tolerance == "auto" else tolerance * float(case.tolerance) / 4
    job: dict[str, Any] = {"version": 1, "method": case.method, "tolerance": wanted}
    if case.pose == "identity":
        job["align"] = "none"
    return damageest.run(job, part=part, scan=Scan(scan.points, unit=scan.unit), settings=case.settings)
