"""One case: a deformed part with known loss is scanned, the program is run, and what it found is compared."""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from damageest_evaluate.scores import iou
from damageest_evaluate.sized import make_sized_damage

from damageest.artefacts import Part, Scan, Solid
from damageest.errors import DamageestError, describe_error
from damageest.geometry.transforms import move_points
from damageest.isolation import cpu_seconds
from damageest.result import Result
from damageest.stages.scan.simulate import Simulate
from damageest_benchmarks.adapting.drift import fit_by_drift
from damageest_benchmarks.adapting.plain import fit_plainly
from damageest_benchmarks.parts import PARTS

TOLERANCE = 0.2
"""In mm; the noise is a quarter of it."""
KINDS = ("chip", "pit", "cut")

DEFORMING = {"plain": fit_plainly, "drift": fit_by_drift}
"""Fits that a part is deformed by before the run."""


@dataclass(frozen=True)
class DeformedCase:
    """``deform``: options of the virtual scanner's `deform`; ``losses``: depth in mm of each random loss, less where
    a part is thin; ``wear``: tools; ``seen``: share of the skin that is scanned, from one side; ``use``: the stage
    `adapt`, `plain`, or `straight`: the same losses in a part as designed, which is what this density of points and
    this noise allow."""

    group: str
    name: str
    part: str
    deform: Mapping[str, float] = field(default_factory=dict)
    losses: Sequence[float] = ()
    wear: Sequence[Mapping[str, Any]] = ()
    seen: float = 1.0
    seed: int = 0
    points: int = 120_000
    use: str = "auto"
    source: str = ""

    def adapted_by(self, use: str) -> DeformedCase:
        return replace(self, use=use, deform={} if use == "straight" else self.deform)

    @property
    def varied(self) -> Mapping[str, float | str]:
        return {"group": self.group, "case": self.name, "adapt": self.use}

    def compute_key(self) -> str:
        """The case's identifier in a file of rows."""
        return hashlib.sha256(json.dumps(vars(self)).encode()).hexdigest()[:16]

    def make_blank_row(self) -> dict[str, Any]:
        """The row of the case without a result."""
        row = {"key": self.compute_key(), "varied": dict(self.varied), "error": "", "true": 0.0, "found": 0.0}
        return row | {
            "iou": 0.0,
            "inside": False,
            "interval": [0.0, 0.0],
            "verdicts": [],
            "amount": 0.0,
            "seconds": 0.0,
        }

    def run(self) -> dict[str, Any]:
        """Runs the case and gives its row."""
        return measure(self)

    def simulate(self) -> tuple[Part, Scan]:
        """Part and scan. Raises LookupError where no loss of this depth fits the part."""
        part = PARTS[self.part]()
        tools: list[Any] = list(self.wear)
        for number, depth in enumerate(self.losses):
            kind = KINDS[(self.seed + number) % len(KINDS)]
            tools += _make_loss(part, 100 * self.seed + number, depth, kind)
        options = {"points": self.points, "noise": TOLERANCE / 4, "pose": "random", "seed": self.seed}
        scanner = Simulate.model_validate({**options, "damage": tools, "deform": self.deform or None})
        scan = scanner.run(part.unit, part)
        if self.seen < 1:
            assert scan.truth is not None
            toward = move_points(scan.points, scan.truth.T_part_scan) @ np.array([0.48, 0.36, 0.8])
            scan = scan.take(toward > np.quantile(toward, 1 - self.seen))
        return part, scan


def _make_loss(part: Part, seed: int, depth: float, kind: str) -> Sequence[Any]:
    """A random loss of this depth, or of half or a quarter of it where the part is too thin."""
    for share in (1.0, 0.5):
        with contextlib.suppress(LookupError):
            return make_sized_damage(part, seed, share * depth, kind).tools
    return make_sized_damage(part, seed, depth / 4, kind).tools


def measure(case: DeformedCase) -> dict[str, Any]:
    """The row of a case: the found volume against the true loss in the deformed part."""
    row, before = case.make_blank_row(), cpu_seconds()
    try:
        part, scan = case.simulate()
        before = cpu_seconds()
        result = run_job(case, part, scan)
    except (DamageestError, LookupError) as error:
        return row | {"error": describe_error(error, 200)}
    row["seconds"] = cpu_seconds() - before
    assert scan.truth is not None
    lost = scan.truth.deformed or scan.truth.damage
    place = result.pose.T_part_scan @ np.linalg.inv(scan.truth.T_part_scan)
    truth = [Solid(move_points(lost.vertices, place), lost.faces)] if lost else []
    true = truth[0].volume if truth else 0.0
    low, high = result.volume_95 or (0.0, float("inf"))
    damages = [site.damage for site in result.sites if site.accepted]
    return row | {
        "true": true,
        "found": sum(damage.volume for damage in damages),
        "iou": iou(damages, truth),
        "inside": bool(low <= true <= high),
        "interval": [low, high],
        "verdicts": [site.verdict.level for site in result.sites],
        "amount": result.adapted.amount if result.adapted else 0.0,
        "stage": sum(record.seconds for record in result.stages if record.stage == "adapt"),
        "model": result.fit.model if result.fit else "",
    }


def run_job(case: DeformedCase, part: Part, scan: Scan) -> Result:
    """The program's result. For `plain` and `drift` the part is deformed by that fit from the rigid pose first."""
    import damageest

    job = {"version": 1, "units": part.unit, "tolerance": TOLERANCE, "report": "none"}
    if case.use not in DEFORMING:
        use = "none" if case.use == "straight" else case.use
        return damageest.run(job, part=part, scan=scan, settings=[f"adapt={use}"])
    pose = damageest.run(job, part=part, scan=scan).pose
    deformed = DEFORMING[case.use](part, move_points(scan.points, pose.T_part_scan))
    return damageest.run(job, part=deformed, scan=scan)
