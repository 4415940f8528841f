"""Writes named shapes to a STEP file that holds them when it is read back.

Tried in this order: as they are, without curves in the parameters of faces, with offset faces as splines, after a
repair; last, only the solids that no way can write get facets.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from damageest.errors import InputError
from damageest_cadquery.reading.read import explore
from damageest_cadquery.solids.planar import build_solid
from damageest_cadquery.solids.split import triangulate
from damageest_cadquery.writing.assembly import NamedShape, write_assembly
from damageest_cadquery.writing.readback import SAME, find_fault, measure_quickly
from damageest_cadquery.writing.step import Outcome, Way, write_first

FINER = (1.0, 0.25, 0.0625)
"""Chords that facets of a solid are tried with, in those asked for."""


def write_shapes(
    scratch: Path, path: Path, name: str, shapes: Sequence[NamedShape], unit: str, chord: float
) -> Outcome:
    """Writes one product, or an assembly; ``made`` are the shapes as they were written.

    ``chord``: of the facets on solids that cannot be written otherwise, in millimetres. Raises OSError.
    """
    lone = scratch.with_name("lone.step")
    return write_first(
        scratch,
        path,
        [
            *_list_ways(name, shapes, unit),
            Way(
                "with facets on the solids that OpenCASCADE does not read back",
                lambda: [_secure(each, lone, unit, chord) for each in shapes],
                partial(_write, name, unit, True),
                _gather,
            ),
        ],
    )


def _list_ways(name: str, shapes: Sequence[NamedShape], unit: str) -> list[Way]:
    plain, bare = (partial(_write, name, unit, curves) for curves in (True, False))
    original = _gather(shapes)

    def change(how: Callable[[Any], Any]) -> list[NamedShape]:
        return [_change(each, how) for each in shapes]

    return [
        Way("as it is", lambda: shapes, plain, lambda _: original),
        Way("without curves in the faces' parameters", lambda: shapes, bare, lambda _: original),
        Way("with its offset faces as splines", lambda: change(_turn_offsets), plain, lambda _: original),
        Way("after a repair (ShapeFix)", lambda: change(_repair), plain, lambda _: original),
    ]


def _write(name: str, unit: str, curves: bool, path: Path, shapes: Sequence[NamedShape]) -> None:
    write_assembly(path, name, shapes, unit, curves)


def _gather(shapes: Sequence[NamedShape]) -> Any:
    return join_shapes([each.shape for each in shapes])


def join_shapes(shapes: Sequence[Any]) -> Any:
    """The shape, or a compound of several."""
    if len(shapes) == 1:
        return shapes[0]
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Compound

    builder, whole = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(whole)
    for shape in shapes:
        builder.Add(whole, shape)
    return whole


def _change(each: NamedShape, how: Callable[[Any], Any]) -> NamedShape:
    """The shape changed, with the names of its faces where these are as many as before."""
    shape = how(each.shape)
    if _count_faces(shape) == _count_faces(each.shape):
        return replace(each, shape=shape)
    return replace(each, shape=shape, names=(), colours=())


def _count_faces(shape: Any) -> int:
    from OCP.TopAbs import TopAbs_FACE

    return len(explore(shape, TopAbs_FACE))


def _turn_offsets(shape: Any) -> Any:
    """The shape with the offsets of splines as splines."""
    from OCP.ShapeCustom import ShapeCustom

    return ShapeCustom.ConvertToBSpline_s(shape, False, False, True)


def _repair(shape: Any) -> Any:
    from OCP.ShapeFix import ShapeFix_Shape

    fix = ShapeFix_Shape(_turn_offsets(shape))
    fix.Perform()
    return fix.Shape()


def _secure(each: NamedShape, scratch: Path, unit: str, chord: float) -> NamedShape:
    """The shape with facets on those of its solids that cannot be written by themselves."""
    from OCP.TopAbs import TopAbs_SOLID

    solids, start = [], 0
    names: list[str] = []
    colours: list[Any] = []
    for solid in explore(each.shape, TopAbs_SOLID):
        count = _count_faces(solid)
        own = NamedShape(
            each.name, solid, each.colour, each.names[start : start + count], each.colours[start : start + count]
        )
        start += count
        made = next(
            (found for found in (_try(way, scratch, solid) for way in _list_ways(each.name, [own], unit)) if found),
            None,
        )
        if made is None:
            made = replace(own, shape=make_facets(solid, chord), names=(), colours=())
        count = _count_faces(made.shape)
        solids.append(made.shape)
        names += made.names or [""] * count
        colours += made.colours or [None] * count
    return NamedShape(each.name, join_shapes(solids), each.colour, names, colours)


def _try(way: Way, scratch: Path, solid: Any) -> NamedShape | None:
    (made,) = way.make()
    way.write(scratch, [made])
    return None if find_fault(scratch, solid) else made


def make_facets(solid: Any, chord: float) -> Any:
    """A solid with planar faces of another one. Raises InputError where its triangles do not close, or not within the
    volume."""
    wanted = measure_quickly(solid)
    for share in FINER:
        try:
            mesh = triangulate(solid, share * chord)
        except ValueError as error:
            raise InputError(f"its triangles do not close: {error}") from None
        if abs(mesh.volume / wanted - 1) < SAME / 2:
            return build_solid(mesh)[0]
    raise InputError("its triangles do not have its volume")
