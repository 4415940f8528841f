"""Finds the exact damage volume of a site: the part's CAD solids split by its inner damage surface.

Tried in this order, and the first that passes the checks is taken: recognised shapes, splines, planes beside facets,
few facets, more. Where planes explain most of it, they come before splines.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh, Part, Solid, Surface
from damageest.errors import InputError
from damageest.geometry.bodies import split_bodies
from damageest.geometry.solids import to_manifold
from damageest_cadquery._check import LIMITS, Measured, check_pieces, measure_inner_area
from damageest_cadquery._cut import Cut, find_inner, make_cut, take_faces
from damageest_cadquery._flat_faces import Flat, find_flat_faces
from damageest_cadquery._polyhedron import Probes, decimate, fit, mark_planes
from damageest_cadquery._read import explore
from damageest_cadquery._shapes import build_shapes, find_shapes
from damageest_cadquery._spline import SPANS, Way, build_splines, drop_tails, find_charts
from damageest_cadquery._split import (
    Piece,
    Tool,
    build_flat,
    is_near,
    is_opencascade_error,
    is_sound,
    is_valid,
    measure_volume,
    split,
    triangulate,
)

PLANES = (300, 500, 800, 1200, 2000)
FACETS = (150, 200, 270, 360, 480, 640, 850, 1150, 1550, 2100, 2900, 4000)
"""Numbers of triangles that are tried; most are given up before a split, by a look at the distances."""
NARROW = 0.8
"""Share of the limit of a form within which a simplified surface must be before it is tried."""
MOST_FACES = 5000
SOME, MOSTLY = 0.25, 0.6
"""Share of the surface on planes from which these are faces of their own, and from which they come before splines."""
MOST_SPLINES = 2
"""Splines near enough that are tried, the coarsest first: each attempt takes a second or more."""
SPECK = 1e-3
"""Share of the damage volume below which a body of it, or a piece that a split leaves over, is dropped."""


Attempt = tuple[str, Callable[[], Tool | None], tuple[float, ...]]
"""Name of a form, what builds its tool, and the fuzzy values to try it with, in millimetres."""


@dataclass(frozen=True, eq=False)
class SiteInput:
    """A site as the exact form needs it, in the job's unit and the part's frame."""

    number: int
    damage: Solid
    surface: Surface
    enclosures: tuple[Solid, ...]
    points: Floats
    accepted: bool
    deposit: Solid | None = None


@dataclass(frozen=True, eq=False)
class Exact:
    """``pieces``: the damage volume; ``rest``: what is left of the solids; ``form``: shapes, spline, planes or facets;
    ``seconds``: of the processor; ``tried``: what was refused before, and why."""

    pieces: tuple[Piece, ...]
    rest: tuple[Piece, ...]
    form: str
    measured: Measured
    seconds: float
    tried: tuple[str, ...] = ()


def start_solids(solids: Sequence[Any]) -> tuple[tuple[Piece, ...], tuple[Any, ...]]:
    """The part's solids as pieces, and its faces by their number."""
    from OCP.TopAbs import TopAbs_FACE

    pieces: list[Piece] = []
    faces: list[Any] = []
    for owner, solid in enumerate(solids):
        own = explore(solid, TopAbs_FACE)
        pieces.append(Piece(solid, owner, tuple((len(faces) + k, -1) for k in range(len(own)))))
        faces += own
    return tuple(pieces), tuple(faces)


def find_exact(
    site: SiteInput, solids: Sequence[Piece], faces: Sequence[Any], part: Part, tolerance: float, off: float = 0.0
) -> tuple[Exact | None, tuple[str, ...]]:
    """The exact damage volume of a site in ``solids``, which are in the job's unit, or None; and what was refused.

    ``off``: how far corners of ``solids`` may lie off their faces.
    """
    start, tried = time.process_time(), []
    cut = make_cut(site.damage, site.surface, part, site.enclosures, tolerance)
    if cut is None:
        return None, ("no surface is known that cuts it out of the part",)
    inner_before = measure_inner_area(solids)
    bodies = _count_bodies(site.damage, solids, tolerance)
    refused = ""
    for form, make, fuzzies in _list_tools(cut, part, tolerance):
        if form.split()[0] == refused:
            continue  # another width of the same shapes
        tool = _call(make)
        for fuzzy in fuzzies if tool is not None else ():
            assert tool is not None
            found = _split_all(solids, tool, fuzzy, site.damage, tolerance)
            if found is None:
                tried.append(f"{form}: it does not separate the solid")
                continue
            pieces, rest = found
            if sum(len(piece.origins) for piece in pieces) > MOST_FACES:
                tried.append(f"{form}: more than {MOST_FACES} faces")
                break
            cut_off = measure_inner_area(rest) - inner_before
            measured = check_pieces(
                form.split()[0], pieces, cut_off, bodies, site.damage, site.surface, part, site.points, tolerance,
                faces, off,
            )  # fmt: skip
            if not measured.reason and not is_sound([piece for piece in rest if piece not in solids]):
                measured = replace(measured, reason="what it leaves of the part is not valid", farthest=np.nan)
            if not measured.reason:
                seconds = time.process_time() - start
                return Exact(pieces, rest, form.split()[0], measured, seconds, tuple(tried)), tuple(tried)
            tried.append(f"{form}: {measured.reason}")
            if np.isfinite(measured.farthest) or measured.reason.startswith("its volume"):
                refused = "shapes"
                break  # it is sound but not near enough, and another fuzzy value does not change that
    return None, tuple(tried) or ("no surface could be built that cuts it out of the part",)


def _count_bodies(damage: Solid, solids: Sequence[Piece], tolerance: float) -> int:
    """How many solids a damage volume is: in a part of several, which its mesh may have united, one or more in each."""
    least, origin = SPECK * damage.volume, damage.bounds.mean(axis=0)
    alone = sum(body.volume > least for body in split_bodies(damage))
    if len({piece.owner for piece in solids}) < 2:
        return alone
    lost, count = to_manifold(damage, origin), 0
    for piece in solids:
        if not is_near(piece.shape, damage):
            continue
        try:
            common = to_manifold(triangulate(piece.shape, tolerance / 16), origin) ^ lost
        except (InputError, ValueError):
            return alone
        count += sum(body.volume() > least for body in common.decompose())
    return count


def _list_tools(cut: Cut, part: Part, tolerance: float) -> Iterator[Attempt]:
    """Names of forms, what builds their tools, and the fuzzy values to try them with, in millimetres."""
    rows = find_inner(cut)
    inner = take_faces(cut.mesh, rows)
    found = find_shapes(inner, tolerance)
    if found.whole:
        for beyond in (2.0, 1.0, 4.0):
            make = partial(build_shapes, inner, found.shapes, found.nearest, tolerance, beyond * tolerance)
            yield f"shapes {beyond:g}", make, (1e-6,)
    flat = [k for k, shape in enumerate(found.shapes) if shape.kind == "plane"]
    area = np.linalg.norm(inner.cross, axis=1)
    share = area[np.isin(found.label, flat)].sum() / area.sum()
    if share < MOSTLY:
        yield from _list_splines(inner, part, tolerance)
    depth = cut.height[np.unique(cut.mesh.faces[rows])]
    deep = depth < -tolerance / 4
    probes = Probes(inner.vertices[deep], np.linalg.norm(inner.vertex_cross, axis=1)[deep])
    if share > SOME:
        planes = mark_planes(cut, rows, found.label, found.shapes, tolerance)
        yield from _list_flat(planes, cut, probes, tolerance, PLANES)
    if share >= MOSTLY:
        yield from _list_splines(inner, part, tolerance)
    yield from _list_flat(mark_planes(cut, rows, found.label, (), tolerance), cut, probes, tolerance, FACETS)


def _list_flat(flat: Flat, cut: Cut, probes: Probes, tolerance: float, counts: Sequence[int]) -> Iterator[Attempt]:
    levels = []
    for count in sorted(counts, reverse=True):  # each from the one before: the first step takes longest
        flat = decimate(flat, count)
        levels.append((count, flat))
    for count, level in reversed(levels):
        if len(level.mesh.faces) > 2 * count:
            continue
        less = fit(level, cut, tolerance)
        form = "planes" if (less.label >= 0).any() else "facets"
        if probes.measure_beyond(less, tolerance / 4) > NARROW * LIMITS[form][0]:
            continue
        tool = build_flat(less.mesh.vertices, find_flat_faces(less))
        if form == "facets" or is_valid(tool):
            yield f"{form} {count}", partial(_give, tool), (1e-6, 1e-4)


def _list_splines(inner: Mesh, part: Part, tolerance: float) -> Iterator[Attempt]:
    wide, near = drop_tails(inner, 1.2 * tolerance), 0
    ways: tuple[Way, ...] = ("seen", "disk")
    for how in ways:
        charts = find_charts(wide, how, part, tolerance)
        if charts is None:
            continue
        for spans in SPANS:
            tool = _call(partial(build_splines, charts, part, spans, tolerance))
            if tool is not None:
                yield f"spline {spans}", partial(_give, tool), (1e-6,)
                near += 1
                if near == MOST_SPLINES:
                    return


def _give(tool: Tool) -> Tool:
    return tool


def _call(make: Callable[[], Tool | None]) -> Tool | None:
    """A tool, or None where OpenCASCADE cannot build it."""
    try:
        return make()
    except Exception as error:
        if not is_opencascade_error(error):
            raise
        return None


def _split_all(
    solids: Sequence[Piece], tool: Tool, fuzzy: float, damage: Solid, tolerance: float
) -> tuple[tuple[Piece, ...], tuple[Piece, ...]] | None:
    """The pieces that are the damage volume, and all others; None where there are none of the first."""
    taken: list[Piece] = []
    rest: list[Piece] = []
    try:
        for solid in solids:
            if not _touch(solid.shape, tool.shape):
                rest.append(solid)
                continue
            made = split(solid.shape, solid.owner, solid.origins, tool, fuzzy)
            if made is None:
                return None
            for piece in made:
                volume = measure_volume(piece.shape)
                if _is_damage(piece, volume, damage, tolerance):
                    taken.append(piece)
                elif volume > SPECK * damage.volume:
                    rest.append(piece)
    except Exception as error:
        # of the others, a piece that cannot be triangulated, or whose triangles do not close
        if not (is_opencascade_error(error) or isinstance(error, (InputError, ValueError))):
            raise
        return None
    return (tuple(taken), tuple(rest)) if taken else None


def _is_damage(piece: Piece, volume: float, damage: Solid, tolerance: float) -> bool:
    if not SPECK * damage.volume < volume < 1.5 * damage.volume:
        return False
    mesh = triangulate(piece.shape, tolerance / 16)
    origin = damage.bounds.mean(axis=0)
    common = to_manifold(mesh, origin) ^ to_manifold(damage, origin)
    return bool(common.volume() > 0.5 * mesh.volume)


def _touch(first: Any, second: Any) -> bool:
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    boxes = []
    for shape in (first, second):
        box = Bnd_Box()
        BRepBndLib.Add_s(shape, box, False)
        boxes.append(box)
    return not boxes[0].IsOut(boxes[1])


def scale_shape(shape: Any, factor: float, T: Floats | None = None) -> Any:
    """A shape scaled about the origin, then moved by ``T`` (4,4); its faces stay in their order."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
    from OCP.gp import gp_Trsf

    transform = gp_Trsf()
    if T is not None:
        transform.SetValues(*np.asarray(T)[:3].ravel().tolist())
    if factor != 1.0:
        size = gp_Trsf()
        size.SetScaleFactor(factor)
        transform = transform.Multiplied(size)
    return BRepBuilderAPI_Transform(shape, transform, True).Shape()
