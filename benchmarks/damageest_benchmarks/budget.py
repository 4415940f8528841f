"""Monte Carlo check of the budget of uncertainty: scans are drawn with the errors that a certificate allows, and each
goes through the whole route, the fit of the pose included.

The parts are small and have few triangles, so that a draw takes about a second. Each draw has new points, noise, a
smooth field of form errors, an offset of the surface, a scale of the scanner, another temperature and expansion than
the job tells, and another pose. The damage is the same in all draws of a part, or another in each: of another size, in
another place, turned. What the budget says is compared with how often the truth lies in the interval, and with how far
the results scatter.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from damageest_evaluate.processes import Row
from damageest_evaluate.tables import describe_measurement, format_markdown

from damageest.artefacts import Floats, Part, Scan, Solid
from damageest.errors import DamageestError, describe_error
from damageest.geometry.lost_depth import measure_lost_depth
from damageest.geometry.solids import to_arrays, to_manifold, to_solid
from damageest.io.digests import digest
from damageest.result import Result

POINTS, NOISE, TOLERANCE = 4000, 0.04, 0.2
"""Points of a scan, their noise and the tolerance in mm."""
FORM, SIZE, LENGTH = 0.02, 0.04, (0.01, 1 / 2000)
"""Standard deviation of the form errors beyond the noise, limit of the probing size error in mm, and of the error of
length: constant, and share of the length."""
WARM = {"part": 60.0, "uncertainty": 5.0, "expansion": 23e-6, "expansion_uncertainty": 3e-6}
"""What the job tells of the temperature; uncertainties are limits."""
ALIKE = 0.4 / 15
"""Length over which the form errors are alike, in diagonals of the part: a patch of skin has that area."""
WAVES = 200
"""Waves of which the field of form errors is made."""
TURN, SHIFT = 0.02, 0.3
"""Largest turn about an axis, in radians, and shift in mm of the part in the scan."""
TOOL_TURN, TOOL_SHIFT, TOOL_SIZE = 20.0, 1.0, 0.2
"""Largest turn of a damage about an axis, in degrees, its shift in mm, and change of its size, where each draw has
another one."""


def _make_block() -> tuple[Any, Any]:
    from manifold3d import Manifold

    return Manifold.cube((20, 15, 10), True), Manifold.sphere(5, 64).translate((-9, 0, 6))


def _make_shaft() -> tuple[Any, Any]:
    from manifold3d import Manifold

    return Manifold.cylinder(24, 7, 7, 64, True), Manifold.cube((8, 9, 8), True).translate((8, 0, 3))


def _make_bracket() -> tuple[Any, Any]:
    from manifold3d import Manifold

    body = Manifold.cube((22, 14, 5), True) + Manifold.cube((5, 14, 16), True).translate((-8.5, 0, 8))
    return body, Manifold.cube((14, 14, 14), True).rotate((0, 40, 30)).translate((14, -9, 3))


def _make_plate() -> tuple[Any, Any]:
    from manifold3d import Manifold

    return Manifold.cube((26, 18, 6), True), Manifold.sphere(7, 96).translate((3, -2, 7.5))


def _make_ring() -> tuple[Any, Any]:
    from manifold3d import Manifold

    body = Manifold.cylinder(9, 11, 11, 72, True) - Manifold.cylinder(10, 5.5, 5.5, 48, True)
    return body, Manifold.cube((6, 6, 7), True).rotate((0, 0, 20)).translate((9.5, 3.5, 4))


PARTS: dict[str, Callable[[], tuple[Any, Any]]] = {
    "block": _make_block, "shaft": _make_shaft, "bracket": _make_bracket, "plate": _make_plate, "ring": _make_ring
}  # fmt: skip
"""Parts, each with the tool that removes its damage; both as manifolds in mm."""


@dataclass(frozen=True)
class BudgetCase:
    """Some ``draws`` on one part, all in one process. ``source``: digest of the code. ``is_same``: whether the damage
    is the same in each."""

    part: str
    seed: int
    draws: int
    source: str = ""
    is_same: bool = True
    varied: Mapping[str, float | str] = field(default_factory=dict)

    def compute_key(self) -> str:
        other = () if self.is_same else ("other damages",)
        return digest("budget", self.part, self.seed, self.draws, self.source, *other)

    def make_blank_row(self) -> Row:
        row: Row = {"key": self.compute_key(), "part": self.part, "seed": self.seed, "varied": dict(self.varied)}
        return row | {"draws": [], "asked": self.draws, "error": "", "seconds": 0.0}

    def run(self) -> Row:
        """The row with each draw's results against the truth."""
        from damageest.registry import Registry

        start, registry, scene, draws = time.perf_counter(), Registry.discover(), make_scene(self.part), []
        for number in range(self.draws):
            rng = np.random.default_rng([self.seed, number])
            drawn = scene if self.is_same else make_scene(self.part, rng)
            draws.append(drawn.run(rng, registry))
        return self.make_blank_row() | {"draws": draws, "seconds": time.perf_counter() - start}


def make_budget_cases(
    parts: Sequence[str], draws: int, batch: int, seed: int, source: str, is_same: bool = True
) -> list[BudgetCase]:
    """Cases of at most ``batch`` draws, the parts in turn, until each part has ``draws``."""
    starts = range(0, draws, batch)
    return [
        BudgetCase(name, 1_000_000 * seed + start, min(batch, draws - start), source, is_same, {"part": name})
        for start in starts
        for name in parts
    ]


@dataclass(frozen=True, eq=False)
class Scene:
    """A ``part``, the ``metal`` that is left of it, and the true volume and depth of the damage."""

    part: Part
    metal: Solid
    volume: float
    depth: float

    def run(self, rng: np.random.Generator, registry: Any) -> Row:
        """One draw through the whole route."""
        import damageest

        job = {
            "version": 1, "tolerance": TOLERANCE, "align": "icp", "adapt": "none", "report": "none",
            "scanner": {"certificate": self.make_certificate()}, "temperature": WARM,
        }  # fmt: skip
        try:
            result = damageest.run(job, part=self.part, scan=Scan(self.draw(rng)), registry=registry)
        except DamageestError as error:
            return {"error": describe_error(error)}
        return self.compare(result)

    def make_certificate(self) -> dict[str, Any]:
        """What the job tells: limits, and the range of 95 % of the points."""
        form = 4 * math.hypot(NOISE, FORM)
        return {"probing_form": form, "probing_size": SIZE, "length": f"{LENGTH[0]} + L*{LENGTH[1]}"}

    def draw(self, rng: np.random.Generator) -> Floats:
        """(N,3) points of a scan with errors of all kinds."""
        points, normals = _sample(self.metal, rng)
        diagonal = self.part.diagonal
        offset = rng.uniform(-SIZE, SIZE) / 2
        waves = rng.normal(size=(WAVES, 3)) / (ALIKE * diagonal)
        phases = rng.uniform(0, 2 * np.pi, WAVES)
        form = FORM * np.sqrt(2 / WAVES) * np.cos(points @ waves.T + phases).sum(axis=1)
        warm = WARM["part"] + rng.uniform(-1, 1) * WARM["uncertainty"]
        expansion = WARM["expansion"] + rng.uniform(-1, 1) * WARM["expansion_uncertainty"]
        length = rng.uniform(-1, 1) * (LENGTH[0] + LENGTH[1] * diagonal) / diagonal
        scale = (1 + expansion * (warm - 20)) * (1 + length)
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_rotvec(rng.uniform(-TURN, TURN, 3)).as_matrix()
        points = scale * (points + (offset + form)[:, None] * normals) @ turn.T + rng.uniform(-SHIFT, SHIFT, 3)
        return np.asarray(points + rng.normal(scale=NOISE, size=points.shape))

    def compare(self, result: Result) -> Row:
        """Whether the truth lies in the intervals, and how far off the results are."""
        found = [site for site in result.sites if site.accepted]
        site = max(found, key=lambda one: one.damage.volume, default=None)
        if site is None or site.uncertainty is None or result.volume_95 is None or result.budget is None:
            return {"error": "no interval"}
        depth, budget = site.depth_95, site.uncertainty.depth_budget
        if depth is None or budget is None:
            return {"error": "no interval"}
        low, high = result.volume_95
        return {
            "error": "",
            "volume_in": bool(low <= self.volume <= high),
            "depth_in": bool(depth[0] <= self.depth <= depth[1]),
            "volume_off": result.damage_volume + result.budget.correction - self.volume,
            "volume_u": result.budget.combined,
            "volume_width": (high - low) / 2 / self.volume,
            "depth_off": depth[0] + budget.expanded - self.depth,
            "depth_u": budget.combined,
            "depth_width": (depth[1] - depth[0]) / 2 / self.depth,
            "sites": len(result.sites),
        }


def make_scene(name: str, rng: np.random.Generator | None = None) -> Scene:
    """The scene of a part, with its own damage, or with one that ``rng`` draws about it."""
    body, tool = PARTS[name]()
    if rng is not None:
        centre = np.array(tool.bounding_box()).reshape(2, 3).mean(axis=0)
        turns, size = rng.uniform(-TOOL_TURN, TOOL_TURN, 3), 1 + rng.uniform(-TOOL_SIZE, TOOL_SIZE)
        moved = centre + rng.uniform(-TOOL_SHIFT, TOOL_SHIFT, 3)
        tool = tool.translate(-centre).rotate(turns).scale((size, size, size)).translate(moved)
    vertices, faces = to_arrays(body)
    part = Part(vertices, faces, unit="mm", path=name)
    metal, damage = to_solid(to_manifold(part) - tool), to_solid(to_manifold(part) ^ tool)
    assert metal is not None
    assert damage is not None
    return Scene(part, metal, damage.volume, measure_lost_depth(damage, part))


def _sample(mesh: Solid, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Points (N,3) that are uniform by area, and the outward normals there."""
    area = 2 * mesh.face_areas
    face = rng.choice(len(area), POINTS, p=area / area.sum())
    first, second = np.sqrt(rng.random(POINTS)), rng.random(POINTS)
    weights = np.stack([1 - first, first * (1 - second), first * second], axis=1)
    return np.einsum("nk,nkj->nj", weights, mesh.triangles[face]), mesh.face_normals[face]


def make_budget_table(rows: Sequence[Row], command: str) -> str:
    """The table in Markdown: a line for each part, and one for all."""
    head = ["part", "draws", "volume: inside", "scatter / u", "mean error / u", "half-width"]
    head += ["depth: inside", "scatter / u", "mean error / u", "half-width", "no interval"]
    names = list(dict.fromkeys(row["part"] for row in rows))
    groups = [(name, [one for row in rows if row["part"] == name for one in row["draws"]]) for name in names]
    groups.append(("all", [one for row in rows for one in row["draws"]]))
    body = [[name, *_count(draws)] for name, draws in groups]
    errors = [f"{row['part']} {row['seed']}: {row['error']}" for row in rows if row["error"]]
    return "\n\n".join([format_markdown([head, *body]), *errors, describe_measurement(f"`{command}`")])


def _count(draws: Sequence[Row]) -> list[str]:
    known = [one for one in draws if not one["error"]]
    words = [str(len(draws))]
    for name in ("volume", "depth"):
        if not known:
            words += ["–"] * 4
            continue
        inside = np.mean([one[f"{name}_in"] for one in known])
        error = math.sqrt(max(inside * (1 - inside), 1 / (4 * len(known))) / len(known))
        ratio = np.array([one[f"{name}_off"] / one[f"{name}_u"] for one in known])
        width = np.median([one[f"{name}_width"] for one in known])
        words += [f"{inside:.1%} ± {error:.1%}", f"{ratio.std():.2f}", f"{ratio.mean():+.2f}", f"{width:.2%}"]
    return [*words, str(len(draws) - len(known))]
