"""The virtual scanner: damages a part with tools, and draws points on what is left."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Ints, Mesh, Part, Solid
from damageest.errors import StageError
from damageest.geometry.solids import compose_shells, to_arrays, to_manifold
from damageest.stages.scan.tools import Tool

DUST = 1e-9
"""Share of the part's volume below which a piece is a rounding error of the Boolean operations."""


def apply_tools(part: Part, tools: Sequence[Tool]) -> tuple[Solid, Solid | None, tuple[str, ...]]:
    """The damaged part, the damage and notes; both solids in the part's frame.

    Pieces that the tools cut loose count as damage too: of each body of the part only the largest piece is kept. Raises
    StageError for a tool that misses the part or is not a solid, and for damage that leaves nothing of the part or lies
    in a closed cavity.
    """
    if not tools:
        return part, None, ()
    from manifold3d import Manifold, OpType

    origin = part.bounds.mean(0)
    whole = to_manifold(part, origin)
    cuts = []
    for number, tool in enumerate(tools, 1):
        cut = build_tool(tool, f"damage tool {number}", origin, part.diagonal)
        if (whole ^ cut).volume() < DUST * part.volume:
            raise make_missed_error(f"damage tool {number} ({tool.tool})", part)
        cuts.append(cut)
    cutter = Manifold.batch_boolean(cuts, OpType.Add)
    kept, lost, loose, cavities = [], [], [], 0
    least = DUST * part.volume
    for body in _split_bodies(whole, least):
        inside, outside = body.split(cutter)
        lost.append(inside)
        cavities -= sum(piece.volume() < 0 for piece in body.decompose())
        cavities += sum(piece.volume() < -DUST * part.volume for piece in outside.decompose())
        pieces = [p for p in _split_bodies(outside, least) if p.volume() > least]
        if pieces:
            pieces.sort(key=lambda p: p.volume(), reverse=True)
            kept.append(pieces[0])
            loose.extend(pieces[1:])
    if not kept:
        raise StageError(
            "the damage tools remove the whole part: nothing is left to scan", remedy="make the tools smaller"
        )
    if cavities > 0:
        raise StageError(
            "the damage tools make a closed cavity inside the part, which a scanner cannot see",
            remedy="move or enlarge the tool so that it reaches the part's surface",
        )
    notes = []
    if loose:
        share = 100 * sum(p.volume() for p in loose) / part.volume
        notes.append(
            f"cut loose by the tools and counted as damage: {share:.2g} % of the part, in {len(loose)} piece(s)"
        )
    damage = _drop_dust(Manifold.batch_boolean([*lost, *loose], OpType.Add), origin, part.volume)
    return _drop_dust(Manifold.compose(kept), origin, part.volume), damage, tuple(notes)


def build_tool(tool: Tool, name: str, origin: Floats, diagonal: float) -> Any:
    """The tool as a Manifold relative to ``origin`` (3,). Raises StageError, which begins with ``name``, where it is
    not a solid."""
    from manifold3d import Error

    try:
        body = tool.build(origin, diagonal)
        fault = "" if body.status() == Error.NoError else body.status().name
        fault = fault or ("it encloses no volume" if body.volume() <= 0 else "")
    except ValueError as error:
        fault = str(error)
    if fault:
        raise StageError(f"{name} ({tool.tool}) is not a solid: {fault}", remedy="change its options")
    return body


def make_missed_error(name: str, part: Part) -> StageError:
    """The error for a tool that is not where the part is."""
    return StageError(
        f"{name} misses the part, which reaches from {_format_point(part.bounds[0])} to "
        f"{_format_point(part.bounds[1])} {part.unit}",
        remedy="move the tool; its coordinates are in the part's frame, in the job's unit",
    )


def _format_point(point: Floats) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in point) + ")"


def _split_bodies(solid: Any, least: float) -> list[Any]:
    """The solid's connected bodies, each with the cavities inside it.

    Shells of no more than the volume ``least`` are rounding errors, and cavities that no body holds.
    """
    shells = [s for s in solid.decompose() if abs(s.volume()) > least]
    outer = [s for s in shells if s.volume() > 0]
    inner = [s for s in shells if s.volume() <= 0]
    if not inner or not outer:
        return list(outer)
    boxes = np.array([s.bounding_box() for s in outer])
    owned: list[list[Any]] = [[s] for s in outer]
    for cavity in inner:
        box = np.array(cavity.bounding_box())
        holds = (boxes[:, :3] <= box[:3]).all(1) & (boxes[:, 3:] >= box[3:]).all(1)
        size = np.where(holds, np.prod(boxes[:, 3:] - boxes[:, :3], axis=1), np.inf)
        if holds.any():
            owned[int(np.argmin(size))].append(cavity)
    return [compose_shells(group) if len(group) > 1 else group[0] for group in owned]


def _drop_dust(body: Any, origin: Floats, volume: float) -> Solid:
    """A Manifold as Solid, without the small pieces that rounding errors leave."""
    shells = body.decompose()
    real = [s for s in shells if abs(s.volume()) > DUST * volume]
    if len(real) < len(shells):
        body = compose_shells(real)
    return Solid(*to_arrays(body, origin))


Weigh = Callable[[Floats], Floats]
"""A function of points (N,3) that gives their weights (N,): how likely each is kept; 0: never."""


def sample_seen(
    mesh: Mesh, faces: NDArray[np.bool_], count: int, rng: np.random.Generator, weigh: Weigh | None, spare: float
) -> tuple[Floats, Ints]:
    """Random points (count,3) on the triangles that are seen, ``faces`` (F,), uniform by area or weighted by ``weigh``,
    and the triangle (count,) of each.

    ``spare``: how many points to draw for each that is kept, where they are weighted. Raises StageError where the
    scanner sees nothing.
    """
    area = 2 * mesh.face_areas * faces
    if not area.any():
        raise make_unseen_error()
    if weigh is None:
        return _sample_faces(mesh, area, count, rng)
    drawn: list[Floats] = []
    on: list[Ints] = []
    keys: list[Floats] = []
    have, tried = 0, 0
    while have < spare * count:
        points, face = _sample_faces(mesh, area, int(spare * count), rng)
        weights = weigh(points)
        seen = weights > 0
        drawn.append(points[seen])
        on.append(face[seen])
        # the smallest of exponential variables over weight: a weighted draw without replacement
        keys.append(rng.exponential(size=int(seen.sum())) / weights[seen])
        have, tried = have + int(seen.sum()), tried + 1
        if have < 1e-3 * tried * count:
            raise make_unseen_error()
    key = np.concatenate(keys)
    chosen = np.argpartition(key, count - 1)[:count]
    return np.concatenate(drawn)[chosen], np.concatenate(on)[chosen]


def make_unseen_error() -> StageError:
    """The error for a scan without surface to draw points on."""
    return StageError(
        "the virtual scanner sees nothing of the part: 'unseen' covers all of it", remedy="make 'unseen' smaller"
    )


def _sample_faces(mesh: Mesh, area: Floats, count: int, rng: np.random.Generator) -> tuple[Floats, Ints]:
    """Random points (count,3), uniform over the triangles, with probabilities proportional to ``area`` (F,), and the
    triangle (count,) of each."""
    total = np.cumsum(area)
    face = np.searchsorted(total, rng.random(count) * total[-1], side="right")
    face = np.minimum(face, int(np.flatnonzero(area)[-1]))
    a, b = rng.random((2, count))
    over = a + b > 1
    a, b = np.where(over, 1 - a, a), np.where(over, 1 - b, b)
    corner = mesh.vertices[mesh.faces[face]]
    origin = corner[:, 0]
    points = origin + a[:, None] * (corner[:, 1] - origin) + b[:, None] * (corner[:, 2] - origin)
    return np.asarray(points), face
