"""Parts with three lost sites, and how they are after the repair: perfect, or wrong in a way that is known."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Solid
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.solids import to_solid

TOLERANCE = 0.2
SPARSE = 3000
"""Points of a sparse scan."""


@dataclass(frozen=True)
class Workpiece:
    """A ``body`` (Manifold) with three sites: ``places`` (3,3) on its skin and outward ``normals`` (3,3) there; the
    balls of ``radii`` (3,) about the places are lost. ``rest`` (3,): a place on the skin away from all sites, with its
    normal ``rest_normal``."""

    body: Any
    places: Floats
    normals: Floats
    radii: Floats
    rest: Floats
    rest_normal: Floats

    def lose(self) -> Any:
        """The body as it was before the repair."""
        from manifold3d import Manifold

        body = self.body
        for place, radius in zip(self.places, self.radii, strict=True):
            body = body - Manifold.sphere(radius, 64).translate(tuple(place))
        return body


@dataclass(frozen=True)
class Repaired:
    """A part after milling: its ``points`` (N,3) in its own frame, the indices of ``wrong`` sites, and whether it is
    wrong ``elsewhere``. ``blind``: sites that the scan does not show well enough to be met."""

    points: Floats
    wrong: tuple[int, ...] = ()
    elsewhere: bool = False
    blind: tuple[int, ...] = ()

    @property
    def is_perfect(self) -> bool:
        """Whether nothing is wrong, and all was seen."""
        return not (self.wrong or self.elsewhere or self.blind)


def make_workpiece(seed: int) -> Workpiece:
    """A bracket, a block with a bore or a stepped shaft, with random sizes."""
    from manifold3d import Manifold

    rng = np.random.default_rng([701, seed])
    a, b, c = rng.uniform(60, 85), rng.uniform(40, 55), rng.uniform(11, 15)
    radii = rng.uniform(4, 6.5, 3)
    if seed % 3 == 0:
        wall = Manifold.cube((12, b, 45))
        body = Manifold.cube((a, b, c)) + wall + Manifold.cylinder(6, 5, 5, 96).translate((a - 10, 10, c))
        places = [(a - 14, b, c), (0.55 * a, 6, c), (6, b / 2, 45)]
        rest, normal = (a / 2, b / 2, 0.0), (0, 0, -1)
        normals = [(0, 0, 1), (0, 0, 1), (0, 0, 1)]
    elif seed % 3 == 1:
        body = Manifold.cube((a, b, 30)) - Manifold.cylinder(50, 8, 8, 128).translate((a / 2, b / 2, -5))
        body = body - Manifold.cube((10, 10, 12)).translate((0, 0, 20))
        places = [(12, b - 10, 30), (a - 9, 10, 30), (a, b / 2, 14)]
        rest, normal = (a / 2, 0.0, 15.0), (0, -1, 0)
        normals = [(0, 0, 1), (0, 0, 1), (1, 0, 0)]
    else:
        body = Manifold.cylinder(a, 14, 14, 192) + Manifold.cylinder(16, 22, 22, 256).translate((0, 0, 20))
        body = body - Manifold.cube((6, 12, 18)).translate((-3, 10, a - 18))
        places = [(14, 0, a - 12), (0, -22, 28), (-14, 0, 9)]
        rest, normal = (0.0, -14.0, a - 20), (0, -1, 0)
        normals = [(1, 0, 0), (0, -1, 0), (-1, 0, 0)]
    return Workpiece(body, np.array(places, float), np.array(normals, float), radii,
                     np.array(rest, float), np.array(normal, float))  # fmt: skip


def scan(body: Any, spacing: float, noise: float, rng: np.random.Generator) -> Floats:
    """Points (N,3) on a body, about ``spacing`` apart."""
    solid = _to_solid(body)
    points, face = sample_by_area(solid, int(solid.area / spacing**2), rng)
    return np.asarray(points + rng.normal(0, noise, len(points))[:, None] * solid.face_normals[face])


def _to_solid(body: Any) -> Solid:
    solid = to_solid(body, np.zeros(3))
    assert solid is not None
    return solid


def _lay(body: Any, place: Floats, normal: Floats, along: Floats | None = None) -> Any:
    """A body with its z along ``normal`` and its origin at ``place``; its x along ``along``."""
    side = np.eye(3)[int(np.argmin(np.abs(normal)))] if along is None else along
    x = side - normal * (side @ normal)
    x = x / np.linalg.norm(x)
    matrix = np.stack([x, np.cross(normal, x), normal, place], axis=1)
    return body.transform(matrix)


class Draw:
    """A workpiece after its repair, with what is drawn for its faults."""

    def __init__(self, work: Workpiece, seed: int) -> None:
        self.work, self.rng = work, np.random.default_rng([702, seed])
        self.site = int(self.rng.integers(3))
        self.spacing, self.noise = float(self.rng.uniform(0.35, 0.8)), float(self.rng.uniform(0.01, 0.035))
        self.place, self.normal = work.places[self.site], work.normals[self.site]
        # a place in the middle of the site's skin also where the site is at an edge
        inward = (work.body.bounding_box()[0:3] + np.array(work.body.bounding_box()[3:6])) / 2 - self.place
        inward = inward - self.normal * (inward @ self.normal)
        length = np.linalg.norm(inward)
        self.middle = self.place + (0.35 * work.radii[self.site] * inward / length if length > 3 else 0 * inward)

    def scan(self, body: Any) -> Floats:
        """A scan of a body."""
        return scan(body, self.spacing, self.noise, self.rng)

    def wrong(self, body: Any, *sites: int, elsewhere: bool = False) -> Repaired:
        """A scan of a body whose ``sites`` are wrong, and the one drawn."""
        return Repaired(self.scan(body), tuple(sorted({self.site, *sites})), elsewhere)

    def tool(self, radius: float, low: float, high: float) -> Any:
        """A cylinder at the site, from ``low`` to ``high`` along its normal."""
        from manifold3d import Manifold

        rod = Manifold.cylinder(high - low, radius, radius, 48).translate((0, 0, low))
        return _lay(rod, self.middle, self.normal)

    def bead(self) -> tuple[Any, Floats]:
        """A weld bead that lies across the site, and its direction."""
        from manifold3d import Manifold

        radius = self.rng.uniform(0.7, 1.2)
        along = np.eye(3)[int(np.argmin(np.abs(self.normal)))]
        rod = Manifold.cylinder(40, radius, radius, 32, True).rotate((0, 90, 0))
        return _lay(rod, self.middle, self.normal, along), along


def _perfect(draw: Draw) -> Repaired:
    return Repaired(draw.scan(draw.work.body))


def _with_fixture(draw: Draw) -> Repaired:
    from manifold3d import Manifold

    bar = _lay(Manifold.cube((50, 9, 30)).translate((-25, -4.5, 0.0)), draw.work.rest, draw.work.rest_normal)
    return Repaired(draw.scan(draw.work.body + bar))


def _low(draw: Draw) -> Repaired:
    return draw.wrong(draw.work.body - draw.tool(draw.rng.uniform(1.5, 3), -draw.rng.uniform(0.35, 0.7), 5))


def _low_across(draw: Draw) -> Repaired:
    from manifold3d import Manifold

    depth = draw.rng.uniform(0.4, 0.6)
    slab = Manifold.cube((200, 36, 30)).translate((-100, -18, -depth))
    return draw.wrong(draw.work.body - _lay(slab, draw.middle, draw.normal), elsewhere=True)


def _high(draw: Draw) -> Repaired:
    return draw.wrong(draw.work.body + draw.tool(draw.rng.uniform(1.5, 2.5), -1, draw.rng.uniform(0.35, 1.0)))


def _bead_across(draw: Draw) -> Repaired:
    return draw.wrong(draw.work.body + draw.bead()[0], elsewhere=True)


def _bead_and_bar(draw: Draw) -> Repaired:
    from manifold3d import Manifold

    bead, along = draw.bead()
    bar = Manifold.cube((9, 60, 30)).translate((11, -30, -1.0))
    return draw.wrong(draw.work.body + bead + _lay(bar, draw.middle, draw.normal, along), elsewhere=True)


def _spot(draw: Draw) -> Repaired:
    points = draw.scan(draw.work.body - draw.tool(1.2, -0.6, 5))
    away = np.linalg.norm(points - draw.middle, axis=1) > 2.6
    return Repaired(points[away], blind=(draw.site,))


def _sparse(draw: Draw) -> Repaired:
    body = draw.work.body - draw.tool(1.7, -0.5, 5)
    return Repaired(scan(body, float(np.sqrt(_to_solid(body).area / SPARSE)), draw.noise, draw.rng), blind=(0, 1, 2))


def _stock_left(draw: Draw) -> Repaired:
    return draw.wrong(draw.work.body + draw.tool(float(draw.work.radii[draw.site]), -1, 1.0))


def _distorted(draw: Draw) -> Repaired:
    points = draw.scan(draw.work.body)
    low, high = points.min(axis=0), points.max(axis=0)
    k = int(np.argmax(high - low))
    share = (points[:, k] - low[k]) / (high[k] - low[k])
    other = (k + 1) % 3 if k == 2 else 2
    points[:, other] += draw.rng.uniform(1.5, 2.5) * np.maximum(share - 0.4, 0) ** 2 / 0.36
    return Repaired(points, elsewhere=True)


KINDS: Mapping[str, Callable[[Draw], Repaired]] = {
    "perfect": _perfect,
    "perfect, moved": _perfect,
    "perfect, with a fixture": _with_fixture,
    "low locally": _low,
    "low across the site": _low_across,
    "high locally": _high,
    "bead across the site": _bead_across,
    "bead that touches a bar": _bead_and_bar,
    "stock left on": _stock_left,
    "spot without points": _spot,
    "sparse": _sparse,
    "distorted": _distorted,
}
"""What may be wrong after a repair."""
