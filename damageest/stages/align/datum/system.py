"""A datum system: the shapes of its datums, and which degrees of freedom each of them takes (ISO 5459).

Lengths in diagonals of the part, places about the middle of its bounds.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Part
from damageest.errors import StageError
from damageest.geometry.sampling import place_along, sample_by_area
from damageest.geometry.shapes import Shape, recognise_shape
from damageest.geometry.smooth_faces import label_smooth_faces
from damageest.stages.align.datum.option import Datum, DatumFeature, System
from damageest.stages.align.wear.datum_skin import DatumSkin

SAMPLES = 20_000
"""Places on the part by which the triangles of a datum are found."""
RIM = 0.05
"""Share of a triangle up to which a selector has not chosen it, as of the faces beside a face that a box selects. A
fifth of it is the least share of a datum that a face has to have, where the part is a mesh."""
OF_SHAPE = 400
"""Places on each shape by which the degrees of freedom are found."""
SMOOTH = 0.87
"""Cosine of the angle between triangles of one face, where the part is a mesh."""
SAME = 1e-5
"""Distance between two shapes, in diagonals, up to which they are one."""
STEP = 1e-3
"""Distance between places along the rim of a datum."""
TAKEN = 1e-3
"""Movement of a datum's skin along its normal, as a share of a motion, from which the datum fixes the motion."""


@dataclass(frozen=True, eq=False)
class Feature:
    """One datum. ``shapes``: those of its faces; ``label`` (F,): which of them each triangle of the part lies on, -1
    for none. ``places``: on each shape (N,3), all over the datum's skin. ``faces``: numbers of its CAD faces. ``rim``
    (M,3): places along the edges of its faces."""

    name: str
    skin: DatumSkin
    shapes: tuple[Shape, ...]
    label: Ints
    places: tuple[Floats, ...]
    faces: tuple[int, ...]
    is_one_sided: bool
    rim: Floats

    @property
    def kind(self) -> str:
        counts = Counter(shape.kind for shape in self.shapes)
        return " and ".join(kind if number == 1 else f"{number} {kind}s" for kind, number in counts.items())

    @property
    def slopes(self) -> Floats:
        """(N,6) how twists change the distances of places all over the datum."""
        return np.concatenate([one.find_slopes(at) for one, at in zip(self.shapes, self.places, strict=True)])

    def is_inner(self, places: Floats, margin: float) -> Flags:
        """(N,) whether places (N,3) on the datum are farther than ``margin`` from its rim."""
        from scipy.spatial import cKDTree

        if not len(self.rim) or not len(places):
            return np.ones(len(places), bool)
        far = cKDTree(self.rim).query(places, distance_upper_bound=margin + STEP)[0]
        return np.asarray(far > np.hypot(margin, STEP / 2))

    def divide(self, free: Floats) -> tuple[Floats, Floats]:
        """The twists (6,K) among ``free`` (6,M), which are orthonormal, that the datum fixes, and those that it leaves
        free (6,M-K)."""
        if not free.shape[1]:
            return free, free
        slopes = self.slopes @ free / np.sqrt(len(self.slopes))
        _, values, turned = np.linalg.svd(slopes, full_matrices=True)
        count = int((values > TAKEN).sum())
        return free @ turned[:count].T, free @ turned[count:].T


@dataclass(frozen=True, eq=False)
class DatumSystem:
    """The datums of a ``part`` in the order of precedence."""

    part: Part
    features: tuple[Feature, ...]

    @classmethod
    def find(cls, part: Part, system: System) -> DatumSystem:
        """Raises StageError where the part has no such face, or it is no plane, cylinder, cone or sphere."""
        return cls(part, tuple(_find_feature(part, name, one) for name, one in system.items()))


def find_datum(part: Part, datum: Datum) -> DatumSkin | DatumSystem | None:
    """The datum of a part, None where the job names none. Raises StageError as `DatumSystem.find` does."""
    if not datum:
        return None
    return DatumSystem.find(part, datum) if isinstance(datum, dict) else DatumSkin.find(part, datum)


def _find_feature(part: Part, name: str, given: DatumFeature | tuple[int | str | object, ...]) -> Feature:
    items = given.skin if isinstance(given, DatumFeature) else given
    skin = DatumSkin.find(part, items)  # type: ignore[arg-type]
    rng = np.random.default_rng(0)
    points, face = sample_by_area(part, SAMPLES, rng)
    every = np.arange(len(part.faces))
    is_chosen = skin.choose(part.triangles.mean(axis=1), every)
    count = np.bincount(face, minlength=len(every))
    share = np.bincount(face, weights=skin.choose(points, face), minlength=len(every)) / np.maximum(count, 1)
    chosen = np.flatnonzero(is_chosen | (share > RIM))
    if not len(chosen):
        raise StageError(
            f"datum {name} selects no skin of the part", "correct align.datum; `damageest faces` lists the CAD faces"
        )
    area = np.where(is_chosen, 1.0, share) * np.linalg.norm(part.cross, axis=1)
    label = np.full(len(part.faces), -1)
    shapes: list[Shape] = []
    middle = part.bounds.mean(axis=0)
    for group in split_faces(part, chosen):
        if area[group].sum() < RIM * area[chosen].sum() / 5 and part.faces_brep is None:
            continue
        found = recognise_shape(part.triangles[group], part.tessellation_error)
        if found is None:
            which = "" if part.faces_brep is None else f" (CAD face {part.faces_brep[group[0]]})"
            raise StageError(
                f"datum {name}: one of its faces{which} is no plane, cylinder, cone or sphere",
                "name other faces; or give the faces as one list, datum: [...], which fits all of them together",
            )
        found = found.scale(middle, part.diagonal)
        same = [k for k, other in enumerate(shapes) if other.is_same(found, SAME)]
        label[group] = same[0] if same else len(shapes)
        if not same:
            shapes.append(found)
    places = []
    for number in range(len(shapes)):
        at, on = sample_by_area(part, 4 * OF_SHAPE, rng, np.flatnonzero(label == number))
        inside = skin.choose(at, on)
        at = at[inside] if inside.sum() > OF_SHAPE // 10 else at
        places.append((at[:: max(1, len(at) // OF_SHAPE)] - middle) / part.diagonal)
    faces = () if part.faces_brep is None else tuple(int(one) for one in np.unique(part.faces_brep[chosen]))
    one_sided = isinstance(given, DatumFeature) and given.fit == "one_sided"
    return Feature(name, skin, tuple(shapes), label, tuple(places), faces, one_sided, _trace_rim(part, label))


def _trace_rim(part: Part, label: Ints) -> Floats:
    """Places (M,3) along the edges that triangles with a ``label`` (F,) share with others."""
    number = np.flatnonzero(label >= 0)
    corners = part.faces[number]
    edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    key = np.sort(edges, axis=1) @ np.array([len(part.vertices), 1])
    # an edge between two triangles of one shape is inside the datum
    _, first, count = np.unique(
        key * (label.max() + 2) + np.tile(label[number], 3), return_index=True, return_counts=True
    )
    vertices = (part.vertices - part.bounds.mean(axis=0)) / part.diagonal
    return place_along(vertices, edges[first[count == 1]], STEP)


def split_faces(part: Part, chosen: Ints) -> list[Ints]:
    """The triangles ``chosen`` (N,) by CAD face; of a mesh, by smooth pieces."""
    if part.faces_brep is not None:
        number: Ints = part.faces_brep[chosen]
    else:
        number = label_smooth_faces(part.faces[chosen], part.face_normals[chosen], SMOOTH)
    return [chosen[number == one] for one in np.unique(number)]
