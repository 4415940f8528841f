"""Joins the solids of stock: those that share no volume are sewn, the others fused.

Sewing takes a moment and changes no face. A Boolean operation takes long where faces coincide, as the walls between
neighbours do, and loses pieces of stock there; so only groups of sewn solids are fused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from manifold3d import Manifold, OpType

from damageest.artefacts import Solid
from damageest.errors import InputError
from damageest.geometry.solids import to_manifold
from damageest_cadquery.reading.read import explore
from damageest_cadquery.solids.joining import StockError, combine, find_twin_pairs, naming, sew, turn_offsets
from damageest_cadquery.solids.split import triangulate

UNION = 3e-3
"""Largest relative difference between the volume of joined solids and that of the union of their triangles."""
SAME = 1e-3
"""Largest relative difference between the volume of sewn solids and the sum of theirs, as triangles."""
DUST = 1e-6
"""Common volume of two solids, as a share of the smaller one's, that is a rounding error."""
NEAR = 1e-4
"""Distance in millimetres between the centres of faces, and between the roots of their areas, that are the same."""


@dataclass(frozen=True, eq=False)
class Lump:
    """A solid of stock, and the numbers of the CAD faces that it is on."""

    solid: Any
    faces: tuple[int, ...]


def sew_groups(lumps: Sequence[Lump], chord: float) -> list[Lump]:
    """Neighbours that share no volume as one solid, as far as they can be sewn; the others as they are."""
    meshes = [_take_triangles(lump, chord) for lump in lumps]
    shared = find_twin_pairs([lump.solid for lump in lumps], NEAR)
    apart = _find_overlaps(meshes, shared, chord)
    group = list(range(len(lumps)))
    for (one, two), _ in sorted(shared.items(), key=lambda item: (-item[1], item[0])):
        a, b = group[one], group[two]
        mine, other = ([k for k, at in enumerate(group) if at == each] for each in (a, b))
        if a != b and not any((min(j, k), max(j, k)) in apart for j in mine for k in other):
            group = [a if at == b else at for at in group]
    joined = []
    for number in dict.fromkeys(group):
        members = [k for k, at in enumerate(group) if at == number]
        joined += _sew([lumps[k] for k in members], [meshes[k] for k in members], chord)
    return joined


def _sew(lumps: Sequence[Lump], meshes: Sequence[Solid], chord: float) -> list[Lump]:
    found = sew([lump.solid for lump in lumps]) if len(lumps) > 1 else None
    if found is None or len(found[0]) != 1:
        return list(lumps)
    whole = Lump(found[0][0], tuple(sorted({number for lump in lumps for number in lump.faces})))
    try:
        volume = _take_triangles(whole, chord).volume
    except StockError:
        return list(lumps)
    return [whole] if abs(volume / sum(mesh.volume for mesh in meshes) - 1) < SAME else list(lumps)


def _find_overlaps(meshes: Sequence[Solid], shared: dict[tuple[int, int], float], chord: float) -> set[tuple[int, int]]:
    """The pairs of solids that have volume in common, more than chords of the faces that they share make."""
    if not meshes:
        return set()
    origin = meshes[0].bounds.mean(axis=0)
    solids = [to_manifold(mesh, origin) for mesh in meshes]
    low, high = np.array([mesh.bounds[0] for mesh in meshes]), np.array([mesh.bounds[1] for mesh in meshes])
    near = ((low[:, None] <= high[None]) & (high[:, None] >= low[None])).all(axis=2)
    found = set()
    for one, two in np.argwhere(np.triu(near, 1)).tolist():
        room = 2 * chord * shared.get((one, two), 0.0) + DUST * min(meshes[one].volume, meshes[two].volume)
        if (solids[one] ^ solids[two]).volume() > room:
            found.add((one, two))
    return found


def _take_triangles(lump: Lump, chord: float) -> Solid:
    with naming(lump.faces):
        try:
            return triangulate(lump.solid, chord)
        except (InputError, ValueError) as error:
            raise StockError(f"its triangles do not close ({str(error)[:80]})") from None


def fuse(lumps: Sequence[Lump], chord: float) -> list[Any]:
    """The solids as one, or as few as they touch in: first with those sewn that share no volume, then as they are; last
    one after the other. Where several have faces that nearly coincide, as mitres and walls at a corner, OpenCASCADE
    leaves pieces out, or does not find where they cut each other. Offsets of splines become splines, with which a
    Boolean operation is faster.

    Raises StockError where none of these gives the union.
    """
    groups = sew_groups(lumps, chord)
    if len(groups) == 1:
        return [groups[0].solid]
    for some in [groups, lumps] if len(groups) < len(lumps) else [groups]:
        solids = [turn_offsets(lump.solid) for lump in some]
        joined = _unite(solids[:1], solids[1:], _to_manifolds(some, chord), chord)
        if joined is not None:
            return joined
    return _fuse_in_turn(groups, chord)


def sew_all(lumps: Sequence[Lump], chord: float) -> list[Any] | None:
    """All solids sewn; None where they do not close, or have volume in common, as over two sides of a slot."""
    found = sew([lump.solid for lump in lumps])
    if found is None:
        return None
    wanted = Manifold.batch_boolean(_to_manifolds(lumps, chord), OpType.Add).volume()
    return found[0] if _has_volume(found[0], wanted, chord) else None


def _fuse_in_turn(lumps: Sequence[Lump], chord: float) -> list[Any]:
    meshes = _to_manifolds(lumps, chord)
    order = np.argsort([mesh.volume() for mesh in meshes], kind="stable")[::-1].tolist()
    joined = [turn_offsets(lumps[order[0]].solid)]
    for rank, k in enumerate(order[1:], start=2):
        with naming(lumps[k].faces):
            found = _unite(joined, [turn_offsets(lumps[k].solid)], [meshes[n] for n in order[:rank]], chord)
            if found is None:
                raise StockError("OpenCASCADE does not join it soundly with that of other faces")
        joined = found
    return joined


def _to_manifolds(lumps: Sequence[Lump], chord: float) -> list[Manifold]:
    meshes = [_take_triangles(lump, chord) for lump in lumps]
    origin = meshes[0].bounds.mean(axis=0)
    return [to_manifold(mesh, origin) for mesh in meshes]


def _unite(solids: Sequence[Any], others: Sequence[Any], meshes: Sequence[Manifold], chord: float) -> list[Any] | None:
    """The union of solids, whose parts have the ``meshes``; None where OpenCASCADE does not find it. It can leave a
    slit where a face of one covers those of two others; joined once more with one of the solids, that is gone."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
    from OCP.TopAbs import TopAbs_SOLID

    wanted = Manifold.batch_boolean(list(meshes), OpType.Add).volume()
    joined = explore(combine(BRepAlgoAPI_Fuse(), solids, others), TopAbs_SOLID)
    if not joined or _has_volume(joined, wanted, chord):
        return joined or None
    again = explore(combine(BRepAlgoAPI_Fuse(), joined, solids[:1]), TopAbs_SOLID)
    return again if again and _has_volume(again, wanted, chord) else None


def _has_volume(joined: Sequence[Any], wanted: float, chord: float) -> bool:
    """Whether the triangles of solids close and have a volume. By triangles: integrals over walls on splines are wrong
    by percents."""
    try:
        volume = sum(triangulate(solid, chord).volume for solid in joined)
    except (InputError, ValueError):
        return False
    return abs(volume / wanted - 1) < UNION
