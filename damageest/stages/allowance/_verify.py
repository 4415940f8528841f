"""Checks what a deposit guarantees, on the finished solid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh, Part
from damageest.errors import StageError
from damageest.geometry.distance import distance_to_edges, distance_to_mesh, is_inside
from damageest.geometry.rays import prepare_rays
from damageest.geometry.selectors import Mask
from damageest.geometry.solids import to_arrays
from damageest.geometry.threads import count_threads
from damageest.stages.allowance._limits import StockConflict
from damageest.stages.allowance._skin import ON_PART, SkinFaces

MAX_VOLUME = 1e-4
"""Largest share of the cavity that may lie outside the deposit, and of the deposit that may lie in metal."""
MAX_MISSED = 0.01
"""Largest share of sampled points with a wrong thickness: at creases the thickness is not defined."""
SAMPLES = 2000
MAX_MITRE = 1.6
"""Largest length of a mitre, in heights."""
REMEDY = "use a smaller outer there, or another inner; if neither helps, report it with the part and the damage volume"


@dataclass(frozen=True, eq=False)
class DepositGeometry:
    """The solids that the check compares, as Manifolds relative to ``origin`` (3,).

    ``deposit``; ``cavity``: what it fills; ``stock``: what it adds to that; ``left``: the metal that is left;
    ``kept_out``: the space to keep free; ``skin``: the skin of the cavity with its heights; ``band``: the intact skin
    that the stock overlaps, or None.
    """

    deposit: Any
    cavity: Any
    stock: Any
    left: Any
    kept_out: Any
    skin: SkinFaces
    band: SkinFaces | None
    origin: Floats

    def skins(self) -> list[SkinFaces]:
        """The skin and, where there is one, the band."""
        return [self.skin] if self.band is None else [self.skin, self.band]


def check_deposit(
    work: DepositGeometry, part: Part, tolerance: float, conflicts: Sequence[StockConflict], refuse: bool = True
) -> tuple[tuple[float, float, float] | None, list[str]]:
    """The smallest, mean and largest thickness of the stock; None where the job asks for none. Where walls or regions
    to keep free end the stock everywhere, the thickness up to them. And what is to be said of it.

    ``conflicts``: places without room, where the stock may be thinner. ``refuse``: whether a thickness that is not as
    wanted is an error; else it is said. Raises StageError with the measured value where the deposit does not keep a
    guarantee.
    """
    said: list[str] = []
    # by volumes: the solids have thousands of faces in common, with which their differences take a second each
    joined = work.cavity.volume() + work.stock.volume() - (work.cavity ^ work.stock).volume()
    missing = (joined - work.deposit.volume()) / work.cavity.volume()
    if missing > MAX_VOLUME:
        raise StageError(f"the deposit does not fill {missing:.2%} of the damage volume", REMEDY)
    entered = ((work.stock ^ work.left).volume() - min(missing, 0) * work.cavity.volume()) / work.deposit.volume()
    if entered > MAX_VOLUME:
        raise StageError(f"{entered:.2%} of the deposit lies in metal that is left", REMEDY)
    over, place = find_stray_stock(work, part, tolerance)
    if over > MAX_MISSED:
        near = ", ".join(f"{value:.4g}" for value in place)
        text = (
            f"there is stock on {over:.1%} of the skin around the damage that must have none, for example at ({near})"
        )
        if refuse:
            raise StageError(text, "use targets with a smaller outer there, keep_out, or interference: clip")
        said.append(text)
    tall = work.skin.select(work.skin.height > 0)
    if not len(tall.faces):
        return None, said
    found = measure_thickness(work, tall, part, conflicts)
    wrong = found.is_wrong(tolerance, ON_PART * part.diagonal)
    if wrong.mean() > MAX_MISSED:
        off = np.where(wrong, np.abs(found.thick - found.height), 0.0)
        near = ", ".join(f"{value:.4g}" for value in found.points[off.argmax()] + work.origin)
        text = f"the thickness of the stock is wrong on {wrong.mean():.1%} of the skin, by up to {off.max():.3g}"
        if refuse:
            raise StageError(text, "use a larger tolerance, a smaller outer, or interference: clip")
        said.append(f"{text}, near ({near})")
    away = 10 * ON_PART * part.diagonal
    # at the border a ray along the normal may leave through the side wall; that is not the thickness
    rims = tall.find_border_edges()
    inner = np.ones(len(found.thick), bool)
    if len(rims):
        inner = distance_to_edges(found.points, tall.vertices, rims) > tolerance / 2
    own = found.thick[inner & ~found.ended & ~found.covered]
    if not len(own):  # nowhere its full height: what there is of it, up to the opposite wall
        own = np.minimum(found.along, found.height)
        first, _ = prepare_rays(part).find_first(found.points + work.origin + away * found.normal, found.normal)
        own = np.minimum(own, first + away)
    return (float(own.min()), float(own.mean()), float(own.max())), said


@dataclass(frozen=True, eq=False)
class Thickness:
    """The measured thickness of the stock at sampled points of skin.

    ``points``: (N,3), with the ``normal`` (N,3). ``along``: (N,) from there to where the deposit ends along it.
    ``height``: (N,) that the job asks for. ``thick``: (N,) measured along the normal; where the point is ``covered``
    (N,) by the stock of other skin, as in a concave corner, distance from the top of the stock to the nearest skin.
    ``ended``: (N,) whether the stock ends at metal, at a region to keep free, or at a place without room.
    """

    points: Floats
    normal: Floats
    along: Floats
    height: Floats
    thick: Floats
    covered: Mask
    ended: Mask

    def is_wrong(self, tolerance: float, rounding: float) -> Mask:
        """(N,) whether the stock is too thin, or more than a tolerance too thick; covered by other stock, it may be as
        thick as a mitre of that stock."""
        low = ~self.covered & (self.thick < self.height * (1 - 1e-6) - rounding)
        bound = np.where(self.covered, MAX_MITRE * self.height.max(), self.height) + tolerance
        return np.asarray(~self.ended & (low | (self.thick > bound)))


def measure_thickness(
    work: DepositGeometry, tall: SkinFaces, part: Part, conflicts: Sequence[StockConflict]
) -> Thickness:
    """Measures the thickness by rays along the normals of the skin with stock, ``tall``."""
    from scipy.spatial import cKDTree

    rounding = 10 * ON_PART * part.diagonal
    points, face = tall.sample(SAMPLES, seed=23)
    normal, height = tall.normal[face], tall.height[face]
    reach = 4 * float(height.max()) + part.diagonal
    far = np.zeros(len(points))
    for k, (a, n) in enumerate(zip(points - rounding * normal, normal, strict=True)):
        hits = [hit.distance * reach for hit in work.deposit.ray_cast(tuple(a), tuple(a + reach * n))
                if np.dot(hit.normal, n) > 0]  # fmt: skip
        # the ray may leave a feather edge before it enters the stock
        far[k] = next((hit - rounding for hit in hits if hit > 2 * rounding), 0.0)
    ends = points + far[:, None] * normal
    nearest = _measure_to_stock(work, ends)
    covered = nearest < far - rounding
    ended = _is_near(ends, work.left, 10 * rounding) | _is_near(ends, work.kept_out, 10 * rounding)
    ended |= _is_inside(ends, work.kept_out)
    for conflict in conflicts:
        away = np.asarray(cKDTree(conflict.points - work.origin).query(points, workers=count_threads())[0])
        ended |= away <= 2 * height
    return Thickness(points, normal, far, height, np.where(covered, nearest, far), covered, ended)


def find_stray_stock(work: DepositGeometry, part: Part, tolerance: float) -> tuple[float, Floats]:
    """Finds stock on skin that must have none, of the damage and of the part around it.

    Skin that is nearer to skin with stock than the stock is high does not count: in a concave corner the stock covers
    it.

    Returns:
        The share of sampled skin without stock that the deposit covers, and one such place (3,) in part coordinates.
    """
    reach = max(float(skin.height.max(initial=0)) for skin in work.skins()) + tolerance
    corners = part.triangles - work.origin
    low, high = work.skin.vertices.min(axis=0) - 2 * reach, work.skin.vertices.max(axis=0) + 2 * reach
    near = np.flatnonzero(((corners.max(axis=1) >= low) & (corners.min(axis=1) <= high)).all(axis=1))
    normal = part.face_normals[near]
    zero = np.zeros(len(near))
    around = SkinFaces(part.vertices - work.origin, part.faces[near], near, normal, zero, zero > 0)
    points, face = around.sample(SAMPLES, seed=29)
    normal = normal[face]
    bare = _measure_to_stock(work, points) > reach
    points, normal = points[bare], normal[bare]
    if not len(points):
        return 0.0, work.origin
    places = np.concatenate([points + share * reach * normal for share in (0.05, 0.3, 0.8)])
    over = _is_inside(places, work.deposit).reshape(3, -1).any(axis=0)
    return float(over.mean()), work.origin + points[over.argmax()]


def _measure_to_stock(work: DepositGeometry, points: Floats) -> Floats:
    """(N,) distance of points (N,3) to the nearest skin with stock."""
    found = np.full(len(points), np.inf)
    for skin in work.skins():
        tall = skin.select(skin.height > 0)
        if len(tall.faces):
            found = np.minimum(found, distance_to_mesh(points, Mesh(tall.vertices, tall.faces)))
    return found


def _is_inside(points: Floats, body: Any) -> Mask:
    """(N,) whether points (N,3) are inside a Manifold, by winding number."""
    if body.is_empty() or not len(points):
        return np.zeros(len(points), bool)
    return is_inside(points, Mesh(*to_arrays(body)))


def _is_near(points: Floats, body: Any, reach: float) -> Mask:
    """(N,) whether points (N,3) are within ``reach`` of the surface of a Manifold."""
    if body.is_empty():
        return np.zeros(len(points), bool)
    return distance_to_mesh(points, Mesh(*to_arrays(body))) <= reach
