"""Depth of wear on the skin along a line."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Mesh
from damageest.artefacts.sections import Section, SectionContour, SectionValue
from damageest.geometry.distance import closest_on_mesh, signed_distance
from damageest.geometry.neighbourhoods import find_neighbours
from damageest.sections.planes import Place

REACH = 1.5
"""Radius about a station, in spacings, whose points its depth is the mean of."""
MOST_POINTS, FEWEST_POINTS = 16, 4
STEP = 0.5
"""Distance between stations, in spacings."""
MOST_STATIONS = 2000


def measure_line(number: int, place: Place, part: Mesh, points: Floats, spacing: float) -> Section:
    """How far the scan is outside the skin that is nearest to a line, at stations along it."""
    assert place.line is not None
    start, end = np.array(place.line.start), np.array(place.line.end)
    length = float(np.linalg.norm(end - start))
    count = int(np.clip(np.ceil(length / max(STEP * spacing, length / MOST_STATIONS)), 8, MOST_STATIONS)) + 1
    along = np.linspace(0, length, count)
    beside = start + along[:, None] * place.along
    skin = closest_on_mesh(beside, part)
    reach = REACH * spacing
    far = float(skin.distance.max())
    near = points[_find_near(points, skin.place, reach + 0.25 * part.diagonal)]
    value, error, found = np.full(count, np.nan), np.zeros(count), np.zeros(count)
    used = 0
    if len(near):
        distance, face = signed_distance(near, part)
        foot = closest_on_mesh(near, part).place
        gap, index = find_neighbours(skin.place, MOST_POINTS, foot, reach)
        facing = part.face_normals[np.append(face, 0)][index]
        same = np.einsum("kij,kj->ki", facing, part.face_normals[skin.face]) > 0.3
        good = np.isfinite(gap) & same
        found = good.sum(axis=1).astype(np.float64)
        depth = np.where(good, np.append(distance, 0.0)[index], 0.0)
        mean = depth.sum(axis=1) / np.maximum(found, 1)
        rest = (np.where(good, depth - mean[:, None], 0.0) ** 2).sum(axis=1) / np.maximum(found - 1, 1)
        known = found >= FEWEST_POINTS
        value, error = np.where(known, mean, np.nan), np.where(known, np.sqrt(rest / np.maximum(found, 1)), 0.0)
        used = len(np.unique(index[good]))
    zero = np.zeros(count)
    contour = SectionContour(np.column_stack([along, zero]), np.column_stack([zero, zero + 1]), value, error, found)
    notes: tuple[str, ...] = ()
    if far > 2 * spacing:
        notes = (
            f"the line is up to {far:.4g} off the skin; the depth is that of the nearest skin; move the line there",
        )
    seen = float(np.isfinite(value).mean())
    if not seen:
        notes = (*notes, "the scan does not show the part here")
    origin, a, o, c = (tuple(v.tolist()) for v in (place.origin, place.along, place.out, place.across))
    return Section(
        number, place.name, "line", origin, a, o, c, (contour,), _list_values(value, error),
        place.group, seen, reach, used, (), notes,
    )  # fmt: skip


def _find_near(points: Floats, places: Floats, reach: float) -> np.ndarray:
    return np.isfinite(find_neighbours(points, 1, places, reach)[0][:, 0])


def _list_values(value: Floats, error: Floats) -> tuple[SectionValue, ...]:
    known = np.isfinite(value)
    if not known.any():
        return tuple(SectionValue(name, None, None, note="no scan points here") for name in ("deepest", "highest"))
    at = np.flatnonzero(known)
    low, high = at[int(value[known].argmin())], at[int(value[known].argmax())]
    seen = "" if known.mean() > 0.98 else f"of the {100 * known.mean():.0f} % that the scan shows"
    return (
        SectionValue("deepest", 0.0, float(value[low]), float(error[low]), note=seen),
        SectionValue("highest", 0.0, float(value[high]), float(error[high]), note=seen),
    )
