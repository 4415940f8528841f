"""How deep a damage volume is below the skin that is lost: not below the nearest skin, which on a thin wall, a lug or a
fin is that of another side, and still there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats, Mesh, Part, Solid
from damageest.geometry.distance import closest_on_mesh, distance_to_mesh
from damageest.geometry.neighbourhoods import find_neighbours
from damageest.geometry.rays import RayCaster
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.skin import find_inner_faces

SAMPLES = 4000
"""Places of the lost skin from which depths are measured."""
GRAZING = 0.02
"""Cosine between a face and the normal of the skin, at least, for the face to lie below that skin and not beside it."""
NEAREST = 12
"""Places on the inner surface that tell the depth of one near them."""
SAME = 0.8
"""Cosine between the normals of two places of the skin, from which they are on the same side."""
UPRIGHT = 0.9
"""Cosine between the way to the nearest lost skin and its normal, at least, for that skin to be above a place."""
AT_RIM = 0.1
"""Distance to the nearest lost skin, as a share of the depth below other skin, up to which a place lies at the rim."""
EVEN = 0.05
"""By how much of itself half of a way through may exceed the distance to the nearest skin, for it to be the wall's
thickness."""
INSIDE = 1e-6
"""How far below the skin a way begins, in diagonals of the damage volume."""


@dataclass(frozen=True, eq=False)
class LostDepth:
    """The depth of a damage volume, along the normals of the lost skin.

    ``skin``: the faces of the volume on the lost skin. ``below`` (K,3): places on the inner surface, with the outward
    normals of the volume ``under`` them (K,3); ``above`` (K,3): the places of the lost skin that are above them, with
    its ``normals`` (K,3). ``through``: thickness of a wall that is lost whole, with both its skins, and the
    place in its ``middle`` (3,); 0 where there is none.
    """

    part: Part
    skin: Mesh
    below: Floats
    under: Floats
    above: Floats
    normals: Floats
    through: float
    middle: Floats

    @classmethod
    def build(cls, damage: Solid, part: Part, inner: Flags | None = None) -> LostDepth:
        """From a damage volume, in the part's unit and frame. ``inner`` (F,): which of its faces lie inside the part,
        where that is known."""
        inner = find_inner_faces(damage, part) if inner is None else inner
        skin = np.flatnonzero(~inner & (damage.face_areas > 0))
        lost, middle = Mesh(damage.vertices, damage.faces[skin]), damage.bounds.mean(axis=0)
        if not len(skin):
            none = np.empty((0, 3))
            return cls(part, lost, none, none, none, none, 0.0, middle)
        above, face = sample_by_area(damage, SAMPLES, np.random.default_rng(0), skin)
        normals, step = damage.face_normals[face], INSIDE * damage.diagonal
        length, hit = RayCaster(damage).find_first(above - step * normals, -normals)
        length = np.where(hit >= 0, length + step, 0.0)
        below = above - length[:, None] * normals
        lean = np.einsum("ij,ij->i", damage.face_normals[hit], normals)
        is_floor = inner[hit] & (hit >= 0) & (-lean > GRAZING)
        is_through = np.flatnonzero(~inner[hit] & (hit >= 0) & (-lean > GRAZING))
        between = (above + below) / 2
        is_wall = distance_to_mesh(between[is_through], part) > (0.5 - EVEN) * length[is_through]
        walls, through = is_through[is_wall], 0.0
        if len(walls):
            thickest = walls[length[walls].argmax()]
            middle, through = between[thickest], float(length[thickest])
        under = damage.face_normals[hit[is_floor]]
        return cls(part, lost, below[is_floor], under, above[is_floor], normals[is_floor], through, middle)

    def measure(self, places: Floats) -> tuple[Floats, Floats]:
        """The depth (N,) of places (N,3) near the inner surface, and the outward normal (N,3) of the skin above each.

        The least of the depths below skin on several sides, for example at an edge. Where no skin is above, the
        distance to the nearest.
        """
        if not len(self.below):
            distance, face, _ = closest_on_mesh(places, self.part)
            return distance, self.part.face_normals[face]
        near = find_neighbours(places, NEAREST, self.below)[1]
        heights = np.einsum("nkj,nkj->nk", self.above[near] - places[:, None], self.normals[near])
        lean = np.einsum("nkj,nj->nk", self.normals[near], self.normals[near[:, 0]])
        heights[:, 1:][lean[:, 1:] > SAME] = np.inf  # of the same skin, the nearest counts
        least, row = heights.argmin(axis=1), np.arange(len(places))
        depth, normals = heights[row, least], self.normals[near[row, least]]
        distance, face, foot = closest_on_mesh(places, self.skin)
        nearest = self.skin.face_normals[face]
        is_above = np.einsum("nj,nj->n", foot - places, nearest) >= UPRIGHT * distance
        is_above &= (np.einsum("nj,nj->n", self.under[near[:, 0]], nearest) < -GRAZING) | (distance < AT_RIM * depth)
        is_exact = is_above & ((distance < depth) | (np.einsum("nj,nj->n", nearest, normals) > SAME))
        normals[is_exact] = nearest[is_exact]
        return np.maximum(np.where(is_exact, distance, depth), 0.0), normals


def measure_lost_depth(damage: Solid, part: Part, places: Floats | None = None) -> float:
    """The largest depth of a damage volume, or of ``places`` (N,3) on its inner surface; at least the thickness of a
    wall that is lost whole. 0 without places."""
    found = LostDepth.build(damage, part)
    places = np.concatenate([damage.vertices, found.below]) if places is None else places
    return max(float(found.measure(places)[0].max(initial=0.0)), found.through) if len(places) else 0.0
