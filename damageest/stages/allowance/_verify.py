"""What a deposit has to keep, checked on the finished solid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh, Part
from damageest.errors import StageError
from damageest.geometry.distance import distance_to_edges, distance_to_mesh, is_inside
from damageest.geometry.solids import to_arrays
from damageest.stages.allowance._limits import StockConflict
from damageest.stages.allowance._selectors import Mask
from damageest.stages.allowance._skin import ON_PART, SkinFaces, normalise

MAX_VOLUME = 1e-4
"""Share of its volume that a damage may stick out of its deposit, or a deposit into metal."""
MAX_MISSED = 0.01
"""Share of sampled points of the skin at which the thickness may be missed: at creases, where it has no one value."""
SAMPLES = 2000
MAX_MITRE = 1.6
"""Of a mitre, in heights."""
REMEDY = "a smaller outer there, or another inner; if neither helps, an export of part and damage would help to mend it"


@dataclass(frozen=True, eq=False)
class DepositGeometry:
    """Everything that the check looks at, as Manifolds relative to ``origin``: the ``deposit``, the ``cavity`` it
    fills, the metal ``left``, what is ``kept_out``; the ``skin`` with its heights, and the ``band`` that the stock runs
    over beside it."""

    deposit: Any
    cavity: Any
    left: Any
    kept_out: Any
    skin: SkinFaces
    band: SkinFaces | None
    origin: Floats

    def skins(self) -> list[SkinFaces]:
        """The skin, and the band where there is one."""
        return [self.skin] if self.band is None else [self.skin, self.band]


def check_deposit(
    work: DepositGeometry, part: Part, tolerance: float, crowds: Sequence[StockConflict]
) -> tuple[float, float, float] | None:
    """The least, mean and largest thickness of the stock; None where none is wanted. Raises StageError with the figure
    where a guarantee is not kept."""

    missing = (work.cavity - work.deposit).volume() / work.cavity.volume()
    if missing > MAX_VOLUME:
        raise StageError(f"the deposit would miss {missing:.2%} of the damage volume", REMEDY)
    entered = (work.deposit ^ work.left).volume() / work.deposit.volume()
    if entered > MAX_VOLUME:
        raise StageError(f"{entered:.2%} of the deposit would lie in metal that is left", REMEDY)
    over, place = find_stray_stock(work, part, tolerance)
    if over > MAX_MISSED:
        near = ", ".join(f"{value:.4g}" for value in place)
        raise StageError(
            f"stock would stand over {over:.1%} of the skin round it that is to have none, as at ({near})",
            "a smaller outer there by targets, or keep_out",
        )
    wanted = work.skin.select(work.skin.height > 0)
    if not len(wanted.faces):
        return None
    found = measure_thickness(work, wanted, part, crowds)
    wrong = found.is_wrong(tolerance, ON_PART * part.diagonal)
    if wrong.mean() > MAX_MISSED:
        worst = float(np.abs(found.thick - found.height)[wrong].max())
        raise StageError(
            f"the stock's thickness is missed on {wrong.mean():.1%} of the skin, by up to {worst:.3g}",
            "a larger tolerance, or a smaller outer",
        )
    # at the very border the way along the normal may lead out of the wall, which is no thickness of the stock
    rims = wanted.find_border_edges()
    inner = np.ones(len(found.thick), bool)
    if len(rims):
        inner = distance_to_edges(found.points, wanted.vertices, rims) > tolerance / 2
    own = found.thick[inner & ~found.ended & ~found.covered]
    return (float(own.min()), float(own.mean()), float(own.max())) if len(own) else None


@dataclass(frozen=True, eq=False)
class Thickness:
    """At ``points`` (N,3) spread over skin with stock: the ``height`` (N,) wanted; how ``thick`` (N,) the stock is
    along the normal, or where it is ``covered`` (N,) by the stock of other skin as in a concave corner, how far its
    surface there stands from the nearest skin; and whether (N,) it is ``ended`` by metal, by something to keep free, or
    by a crowded place."""

    points: Floats
    height: Floats
    thick: Floats
    covered: Mask
    ended: Mask

    def is_wrong(self, tolerance: float, rounding: float) -> Mask:
        """(N,) where the stock is thinner than wanted, or more than a tolerance thicker; covered by other stock, it may
        be as thick as that one's mitre."""
        low = ~self.covered & (self.thick < self.height * (1 - 1e-6) - rounding)
        bound = np.where(self.covered, MAX_MITRE * self.height.max(), self.height) + tolerance
        return np.asarray(~self.ended & (low | (self.thick > bound)))


def measure_thickness(
    work: DepositGeometry, wanted: SkinFaces, part: Part, crowds: Sequence[StockConflict]
) -> Thickness:
    """Measured by rays along the normal of the skin with stock."""
    from scipy.spatial import cKDTree

    rounding = 10 * ON_PART * part.diagonal
    points, face = wanted.sample(SAMPLES, seed=23)
    normal, height = wanted.normal[face], wanted.height[face]
    reach = 4 * float(height.max()) + part.diagonal
    far = np.zeros(len(points))
    for k, (a, n) in enumerate(zip(points - rounding * normal, normal, strict=True)):
        hits = [hit.distance * reach for hit in work.deposit.ray_cast(tuple(a), tuple(a + reach * n))
                if np.dot(hit.normal, n) > 0]  # fmt: skip
        # a feather edge may be left at once, before the stock begins
        far[k] = next((hit - rounding for hit in hits if hit > 2 * rounding), 0.0)
    ends = points + far[:, None] * normal
    nearest = _measure_to_stock(work, ends)
    covered = nearest < far - rounding
    ended = _is_near(ends, work.left, 10 * rounding) | _is_near(ends, work.kept_out, 10 * rounding)
    ended |= _is_inside(ends, work.kept_out)
    for crowd in crowds:
        away = np.asarray(cKDTree(crowd.points - work.origin).query(points, workers=2)[0])
        ended |= away <= 2 * height
    return Thickness(points, height, np.where(covered, nearest, far), covered, ended)


def find_stray_stock(work: DepositGeometry, part: Part, tolerance: float) -> tuple[float, Floats]:
    """The share of sampled skin without stock, of the damage and of the part round it, that the deposit stands over all
    the same, and one such place (3,) in the part's frame. Skin nearer to skin with stock than that is high does not
    count: in a concave corner the stock leans on it."""
    most = max(float(skin.height.max(initial=0)) for skin in work.skins()) + tolerance
    corners = part.triangles - work.origin
    low, high = work.skin.vertices.min(axis=0) - 2 * most, work.skin.vertices.max(axis=0) + 2 * most
    near = np.flatnonzero(((corners.max(axis=1) >= low) & (corners.min(axis=1) <= high)).all(axis=1))
    normal = normalise(part.cross)[near]
    zero = np.zeros(len(near))
    around = SkinFaces(part.vertices - work.origin, part.faces[near], near, normal, zero, zero > 0)
    points, face = around.sample(SAMPLES, seed=29)
    normal = normal[face]
    bare = _measure_to_stock(work, points) > most
    points, normal = points[bare], normal[bare]
    if not len(points):
        return 0.0, work.origin
    places = np.concatenate([points + share * most * normal for share in (0.05, 0.3, 0.8)])
    over = _is_inside(places, work.deposit).reshape(3, -1).any(axis=0)
    return float(over.mean()), work.origin + points[over.argmax()]


def _measure_to_stock(work: DepositGeometry, points: Floats) -> Floats:
    """(N,) distance to the nearest skin with stock."""
    found = np.full(len(points), np.inf)
    for skin in work.skins():
        tall = skin.select(skin.height > 0)
        if len(tall.faces):
            found = np.minimum(found, distance_to_mesh(points, Mesh(tall.vertices, tall.faces)))
    return found


def _is_inside(points: Floats, body: Any) -> Mask:
    """(N,) by winding number."""
    if body.is_empty() or not len(points):
        return np.zeros(len(points), bool)
    return is_inside(points, Mesh(*to_arrays(body)))


def _is_near(points: Floats, body: Any, reach: float) -> Mask:
    if body.is_empty():
        return np.zeros(len(points), bool)
    return distance_to_mesh(points, Mesh(*to_arrays(body))) <= reach
