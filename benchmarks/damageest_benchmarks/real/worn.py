"""Made parts that are worn as real ones are: smoothly, by less than a millimetre, on skin that is off by a little
everywhere, and meshed by the scanner's software, so that the points lie on facets and have no noise."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from damageest_evaluate.processes import Row

from damageest.artefacts import Floats, Part, Scan
from damageest.errors import DamageestError, describe_error
from damageest.geometry.solids import to_manifold, to_solid
from damageest_benchmarks.real.reference import sample

EDGE = 0.8
"""Edges of the scanner's mesh in mm, about."""
DEPTHS, FORMS = (0.3, 0.6), (0.04, 0.07)
"""Depth of the wear, and how far all of the skin is off, in mm."""
TOLERANCE = 0.2
POINTS = 60_000
DRAWS = 60
SAME = 0.05
"""Share of the true volume from which an accepted site elsewhere is a false one."""


@dataclass(frozen=True)
class Worn:
    """A ``part``, its ``scan`` and the volume that is worn: ``deep``, where it is deeper than the tolerance, and
    ``whole``; ``places`` (K,3) on the part, of which ``depths`` (K,) are worn."""

    part: Part
    scan: Scan
    deep: float
    whole: float
    places: Floats
    depths: Floats


def _cylinder(radius: float, height: float, z: float = 0.0) -> Any:
    from manifold3d import Manifold

    return Manifold.cylinder(height, radius, radius, 96).translate((0, 0, z))


def _box(x: float, y: float, z: float) -> Any:
    from manifold3d import Manifold

    return Manifold.cube((x, y, z), True)


def _bump(value: Floats, middle: float, half: float) -> Floats:
    """1 in the middle, smoothly 0 at half a width from it."""
    return np.where(np.abs(value - middle) < half, np.cos(np.pi * (value - middle) / (2 * half)) ** 2, 0.0)


def _around(x: Floats, radius: float, z: tuple[float, float], arc: float, outward: bool) -> Floats:
    """Wear of a round face about z: of its whole turn where ``arc`` is pi, else on one side."""
    r, angle = np.hypot(x[:, 0], x[:, 1]), np.arctan2(x[:, 1], x[:, 0])
    on = np.abs(r - radius) < 0.02 * radius
    side = np.ones(len(x)) if arc >= np.pi else _bump(angle, 0.4, arc)
    way = x * [1, 1, 0] / np.maximum(r, 1e-9)[:, None] * (-1 if outward else 1)
    return np.asarray(way * (on * side * _bump(x[:, 2], *z))[:, None])


def _on_face(x: Floats, axis: int, at: float, spread: tuple[float, float]) -> Floats:
    """Wear of a flat face across an axis, smooth over its middle."""
    one, other = (k for k in range(3) if k != axis)
    on = np.abs(x[:, axis] - at) < 1e-6
    way = np.zeros((len(x), 3))
    way[:, axis] = -np.sign(at) * on * _bump(x[:, one], 0.0, spread[0]) * _bump(x[:, other], 0.0, spread[1])
    return way


def _make_bush() -> Any:
    return _cylinder(20, 30) - _cylinder(12, 40, -5) - _box(6, 60, 8)


def _make_die() -> Any:
    return _box(60, 40, 24) - _cylinder(10, 40, -20) - _box(14, 14, 14).translate((24, 15, 8))


def _make_rail() -> Any:
    return _box(100, 30, 20) - _box(110, 8, 8).translate((0, 12, 8))


def _make_cam() -> Any:
    return _cylinder(16, 14, -7) + _box(20, 14, 14).translate((14, 0, 0)) - _cylinder(6, 30, -15)


def _make_seat() -> Any:
    return _cylinder(14, 60) + _cylinder(22, 12, 24) - _box(6, 4, 20).translate((0, 14, 6))


def _make_punch() -> Any:
    return _cylinder(9, 50) + _box(30, 24, 14) - _box(8, 8, 20).translate((15, 12, 0))


KINDS: Mapping[str, tuple[Callable[[], Any], Callable[[Floats], Floats]]] = {
    "bush": (_make_bush, lambda x: _around(x, 12, (15, 14), np.pi, False)),
    "die": (_make_die, lambda x: _around(x, 10, (4, 12), np.pi, False)),
    "rail": (_make_rail, lambda x: _on_face(x, 2, 10.0, (40, 14))),
    "cam": (_make_cam, lambda x: _on_face(x, 0, 24.0, (7, 7))),
    "bearing seat": (_make_seat, lambda x: _around(x, 14, (48, 10), 1.6, True)),
    "punch": (_make_punch, lambda x: _around(x, 9, (38, 11), 1.3, True)),
}
"""Each kind's body, and how its skin at vertices (V,3) is worn: (V,3), at most of length 1."""


def make_worn(kind: str, seed: int) -> Worn:
    """A worn part of a kind. The skin is off by a sum of slow waves, as long as the part or half of it."""
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng([691, seed])
    make, wear = KINDS[kind]
    body = make()
    solid = to_solid(body, np.zeros(3))
    assert solid is not None
    part = Part(solid.vertices, solid.faces, unit="mm")
    fine = to_solid(to_manifold(solid).refine_to_length(EDGE), np.zeros(3))
    assert fine is not None
    size = part.diagonal
    shape = np.zeros((len(fine.vertices), 3))
    for _ in range(4):
        wave = rng.normal(size=3) * 2 * np.pi / (size * rng.uniform(0.5, 1.0)) / np.sqrt(3)
        shape += np.outer(np.sin(fine.vertices @ wave + rng.uniform(0, 2 * np.pi)), rng.normal(size=3))
    shape *= rng.uniform(*FORMS) / np.linalg.norm(shape, axis=1).max()
    depth = rng.uniform(*DEPTHS) * wear(fine.vertices)
    lost = np.linalg.norm(depth, axis=1)
    worn = fine.vertices + shape + depth
    area = fine.face_areas
    of_face = lost[fine.faces].mean(axis=1)
    points = sample(worn, fine.faces, POINTS, seed).places
    turn = Rotation.random(random_state=np.random.default_rng([692, seed])).as_matrix()
    scan = Scan(points @ turn.T + rng.uniform(-50, 50, 3), unit="mm")
    deep = of_face > TOLERANCE
    return Worn(part, scan, float((area * of_face)[deep].sum()), float(area @ of_face), fine.vertices, lost)


@dataclass(frozen=True)
class WornCase:
    """A draw of the family."""

    kind: str
    seed: int
    source: str = ""
    varied: Mapping[str, float | str] = field(default_factory=dict)

    def compute_key(self) -> str:
        """The case's identifier in a file of rows."""
        return hashlib.sha256(json.dumps([self.kind, self.seed, self.source]).encode()).hexdigest()[:16]

    def make_blank_row(self) -> Row:
        """The row of the case without a result."""
        row = {"key": self.compute_key(), "kind": self.kind, "seed": self.seed, "volume": 0.0, "low": 0.0, "high": 0.0}
        return row | {"true": [], "verdict": "none", "codes": [], "comes_out": False, "silent": False, "error": "",
                      "seconds": 0.0}  # fmt: skip

    def run(self) -> Row:
        """As `run_worn`."""
        return run_worn(self)


def run_worn(case: WornCase) -> Row:
    """Runs a draw: it comes out where the site on the wear is accepted and its interval holds what is worn; it is
    silent where an accepted site does not, or lies elsewhere."""
    from scipy.spatial import cKDTree

    import damageest

    row, worn, start = case.make_blank_row(), make_worn(case.kind, case.seed), time.perf_counter()
    row["true"] = [worn.deep, worn.whole]
    try:
        job = {"version": 1, "units": "mm", "tolerance": TOLERANCE, "allowance": "none"}
        result = damageest.run(job, part=worn.part, scan=worn.scan)
    except DamageestError as error:
        return row | {"error": describe_error(error, 300), "seconds": time.perf_counter() - start}
    row["seconds"] = time.perf_counter() - start
    tree = cKDTree(worn.places)
    for site in sorted(result.sites, key=lambda one: one.damage.volume):
        nearest = tree.query(site.damage.triangles.mean(axis=1))[1]
        is_wear = bool(np.median(worn.depths[nearest]) > TOLERANCE / 4)
        low, high = site.volume_95 or (0.0, 0.0)
        held = low <= worn.whole and high >= worn.deep
        if is_wear:
            codes = sorted({reason.code for reason in site.verdict.reasons if reason.effect == "contradicts"})
            row |= {"volume": site.damage.volume, "low": low, "high": min(high, 1e9), "verdict": site.verdict.level}
            row |= {"codes": codes, "comes_out": bool(site.accepted and held)}
        if site.accepted and (not held if is_wear else site.damage.volume > SAME * worn.whole):
            row["silent"] = True
    return row


def make_worn_cases(every: int, source: str) -> list[WornCase]:
    """One draw in ``every`` of the 60 of the family, the kinds in turn."""
    names = list(KINDS)
    return [WornCase(names[k % len(names)], k, source) for k in range(0, DRAWS, every)]


def make_worn_table(rows: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Head and body of the table: a line for each kind, and one for all."""
    groups = {kind: [row for row in rows if row["kind"] == kind] for kind in KINDS} | {"all": list(rows)}
    head = ["kind", "draws", "come out", "doubtful", "silent", "no site", "doubted by"]
    body = []
    for name, group in groups.items():
        codes = sorted(
            {code for row in group if row["verdict"] == "doubtful" for code in row["codes"] or ["its interval"]}
        )
        counts = [
            sum(row["comes_out"] for row in group), sum(row["verdict"] == "doubtful" for row in group),
            sum(row["silent"] for row in group), sum(row["verdict"] == "none" for row in group),
        ]  # fmt: skip
        body.append([name, str(len(group)), *map(str, counts), ", ".join(codes)])
    return [head, *(line for line in body if line[1] != "0")]
