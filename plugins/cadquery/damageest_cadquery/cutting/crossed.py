"""Faces of a CAD file that cross one another: a loss that lies on these cannot be cut out of the part."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from damageest.artefacts import Mesh, Solid
from damageest.errors import InputError
from damageest.geometry.undoing import find_crossings
from damageest_cadquery.solids.split import Piece, is_near, is_opencascade_error

MOST_PAIRS = 12
"""Pairs of faces whose triangles cross that are looked at."""


def find_crossed(solids: Sequence[Piece], faces: Sequence[Any], damage: Solid, tolerance: float) -> list[int]:
    """The numbers of faces of one solid that cross one another within the box of a damage volume. Their triangles say
    which to look at; those of faces that nearly touch cross too, so OpenCASCADE decides."""
    from damageest_cadquery.reading.tessellate import tessellate

    found: set[int] = set()
    low, high = damage.bounds + tolerance * np.array([[-1.0], [1.0]])
    for piece in solids:
        if not is_near(piece.shape, damage):
            continue
        try:
            made = tessellate([piece.shape], tolerance / 16, 20.0, lambda face: "")
        except (InputError, ValueError):
            continue
        corners = made.vertices[made.faces]
        near = ((corners.min(axis=1) <= high) & (corners.max(axis=1) >= low)).all(axis=1)
        rows, numbers = made.faces[near], made.faces_brep[near]
        edges, crossed = find_crossings(Mesh(made.vertices, rows))
        pairs = set()
        for edge, face in zip(edges, crossed, strict=True):
            mine = numbers[(rows == edge[0]).any(axis=1) & (rows == edge[1]).any(axis=1)]
            pairs |= {(min(k, numbers[face]), max(k, numbers[face])) for k in mine if k != numbers[face]}
        for one, two in sorted(pairs)[:MOST_PAIRS]:
            ends = [piece.origins[k][0] for k in (one, two)]
            if min(ends) >= 0 and _cross(*(faces[k] for k in ends)):
                found.update(ends)
    return sorted(found)


def _cross(one: Any, two: Any) -> bool:
    """Whether two faces have points in common that are no edge or corner of both."""
    from OCP.BOPAlgo import BOPAlgo_SelfIntersect
    from OCP.BRep import BRep_Builder
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Check
    from OCP.TopoDS import TopoDS_Compound

    builder, both = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(both)
    for face in (one, two):
        builder.Add(both, face)
    try:
        check = BRepAlgoAPI_Check(both, False, True)
        check.Perform()
    except Exception as error:
        if not is_opencascade_error(error):
            raise
        return False
    return any(
        result.GetCheckStatus() == BOPAlgo_SelfIntersect
        and all(any(shape.IsSame(face) for shape in result.GetFaultyShapes1()) for face in (one, two))
        for result in check.Result()
    )
