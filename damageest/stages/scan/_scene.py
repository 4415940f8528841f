"""What a virtual scanner has before it: the damaged part, displaced pieces of it, added metal, and surroundings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field

from damageest.artefacts import Floats, Part, Solid
from damageest.errors import StageError
from damageest.geometry.solids import compose_shells, to_arrays, to_manifold
from damageest.options import Options
from damageest.stages.scan.scanner import DUST, apply_tools, build_tool, make_missed_error
from damageest.stages.scan.tools import AnyTool, CylinderTool, Direction, SolidTool, Tool, Vector


class DetachedPiece(Options):
    """A piece of the part that is moved rather than removed: a displaced fragment."""

    model_config = ConfigDict(defer_build=True)
    piece: AnyTool = Field(description="the piece: what of the part lies within this tool")
    shift: Vector = Field((0.0, 0.0, 0.0), description="shift of the piece along x, y and z, in the job's unit")
    rotation: Vector = Field(
        (0.0, 0.0, 0.0),
        description="rotation in degrees about the fixed x, then y, then z axis, about the centre of the piece's "
        "bounding box",
    )


class Table(Options):
    """A plane plate that the part stands on. Only its upper side has points."""

    model_config = ConfigDict(defer_build=True)
    direction: Direction = Field(
        (0.0, 0.0, -1.0), description="direction from the part to the table; its length does not matter"
    )
    margin: float = Field(
        0.25,
        ge=0,
        description="width of the plate beyond the part, in diagonals of the part",
        allow_inf_nan=False,
    )


@dataclass(frozen=True, eq=False)
class Scene:
    """``body`` is all that the scanner sees, ``bare`` (F,) its faces that never get points. ``damage`` and ``added``:
    the metal that the part lacks, and the metal outside it. All in the part's frame."""

    body: Solid
    bare: NDArray[np.bool_]
    damage: Solid | None
    added: Solid | None
    notes: tuple[str, ...]


def build_scene(
    part: Part,
    damage: Sequence[Tool],
    added: Sequence[SolidTool],
    detached: Sequence[DetachedPiece],
    surroundings: Sequence[SolidTool],
    table: Table | None,
) -> Scene:
    """The scene in the part's frame. Raises StageError for a tool that is not a solid, that misses the part, or that
    adds nothing, and where nothing of the part is left."""
    left, lost, notes = apply_tools(part, damage)
    extra: Solid | None = None
    origin = part.bounds.mean(axis=0)
    body = to_manifold(left, origin) if added or detached or surroundings or table else None
    if added or detached:
        body = _move_pieces(body, detached, part, origin)
        for number, tool in enumerate(added, 1):
            more = build_tool(tool, f"added tool {number}", origin, part.diagonal)
            if (more - body).volume() < DUST * part.volume:
                raise StageError(
                    f"added tool {number} ({tool.tool}) lies inside the part: it adds nothing",
                    remedy="move the tool so that it is partly outside the part",
                )
            body += more
        whole = to_manifold(part, origin)
        lost, extra = (_keep_real(rest, origin, part.volume) for rest in (whole - body, body - whole))
    for number, tool in enumerate(surroundings, 1):
        body += build_tool(tool, f"surroundings tool {number}", origin, part.diagonal)
    if table is None:
        seen = left if body is None else Solid(*to_arrays(body, origin))
        return Scene(seen, np.zeros(len(seen.faces), dtype=bool), lost, extra, notes)
    down = np.array(table.direction) / np.linalg.norm(table.direction)
    vertices = to_arrays(body)[0]
    level = float((vertices @ down).max())
    centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    foot = origin + centre + (level - centre @ down) * down
    across = vertices - centre - np.outer((vertices - centre) @ down, down)
    plate = CylinderTool(
        point=tuple(foot),
        axis=tuple(down),
        radius=float(np.linalg.norm(across, axis=1).max()) + table.margin * part.diagonal,
        length=0.1 * part.diagonal,
    )
    body += build_tool(plate, "table", origin, part.diagonal)
    seen = Solid(*to_arrays(body, origin))
    below = (seen.triangles.mean(axis=1) - foot) @ down > 1e-6 * part.diagonal
    return Scene(seen, below, lost, extra, notes)


def _move_pieces(body: Any, detached: Sequence[DetachedPiece], part: Part, origin: Floats) -> Any:
    """The damaged part, a Manifold relative to ``origin`` (3,), with its pieces moved."""
    moved = []
    for number, item in enumerate(detached, 1):
        cutter = build_tool(item.piece, f"detached piece {number}", origin, part.diagonal)
        piece, body = body.split(cutter)
        if piece.volume() < DUST * part.volume:
            raise make_missed_error(f"detached piece {number} ({item.piece.tool})", part)
        box = np.array(piece.bounding_box())
        centre = (box[:3] + box[3:]) / 2
        turned = piece.translate(tuple(-centre)).rotate(item.rotation)
        moved.append(turned.translate(tuple(centre + item.shift)))
    if body.volume() < DUST * part.volume:
        raise StageError("the detached pieces are the whole part", remedy="make the tools of `detached` smaller")
    for piece in moved:
        body += piece
    return body


def _keep_real(body: Any, origin: Floats, volume: float) -> Solid | None:
    """A Manifold as Solid without pieces that are rounding errors; None where nothing else is left."""
    pieces = [piece for piece in body.decompose() if abs(piece.volume()) > DUST * volume]
    return Solid(*to_arrays(compose_shells(pieces), origin)) if pieces else None
