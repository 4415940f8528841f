"""The regions that the deposit must not enter, as one solid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Part, Solid
from damageest.errors import DamageestError, StageError
from damageest.stages.allowance._selectors import Bar, KeepOut, StockPlan
from damageest.stages.allowance._skin import SkinFaces, label_skin
from damageest.stages.allowance._stock import build_stock

MAX_ENTERED = 1e-3
"""Largest share of a damage volume that may lie in a solid to keep free."""
SIDES = 256
"""Number of sides of a round bar; its polygon is drawn around the circle, at most 0.01 % wider."""


def build_keep_out(
    items: Sequence[KeepOut],
    skin: SkinFaces,
    filled: Any,
    part: Part,
    plan: StockPlan,
    reach: float,
    origin: Floats,
    tolerance: float,
) -> Any:
    """A Manifold relative to ``origin`` (3,): the solids to keep free, and the space up to ``reach`` above skin to keep
    free.

    Raises StageError where the cavity ``filled`` overlaps one of the solids, or a file holds no solid.
    """
    from manifold3d import Manifold, OpType

    bodies = []
    for number, item in enumerate(items):
        if not item.is_solid():
            continue
        body = _build_body(item, part, origin)
        entered = (body ^ filled).volume() / filled.volume()
        if entered > MAX_ENTERED:
            raise StageError(
                f"{entered:.1%} of the damage volume, {entered * filled.volume():.4g}, lies in keep_out {number + 1}, "
                "but the deposit has to fill all of it",
                "use a smaller solid there, or conditions on skin (faces, facing, kind), which only exclude the stock",
            )
        bodies.append(body)
    if plan.skin_to_keep_free():
        bodies.append(build_stock(replace(skin, height=np.where(skin.free, reach, 0.0)), tolerance, inset=0))
        around = _take_skin_near(skin, part, plan, reach, origin)
        if around is not None:
            bodies.append(build_stock(replace(around, height=np.where(around.free, reach, 0.0)), tolerance, inset=0))
    return Manifold.batch_boolean(bodies, OpType.Add) if bodies else Manifold()


def _take_skin_near(skin: SkinFaces, part: Part, plan: StockPlan, reach: float, origin: Floats) -> SkinFaces | None:
    """The skin of the part near the damage; None where there is none."""
    corners = part.triangles - origin
    low, high = skin.vertices.min(axis=0) - 2 * reach, skin.vertices.max(axis=0) + 2 * reach
    near = ((corners.max(axis=1) >= low) & (corners.min(axis=1) <= high)).all(axis=1)
    return label_skin(part.vertices - origin, part.faces[near], part, plan, origin) if near.any() else None


def _build_body(item: KeepOut, part: Part, origin: Floats) -> Any:
    from manifold3d import Manifold

    if item.box is not None:
        low, high = np.array(item.box) - origin
        return Manifold.cube(tuple(high - low)).translate(tuple(low))
    if item.cylinder is not None:
        return _build_bar(item.cylinder, origin)
    assert item.mesh is not None
    return _read_mesh(item.mesh, part, origin)


def _build_bar(bar: Bar, origin: Floats) -> Any:
    from manifold3d import Manifold

    start, axis = np.array(bar.start) - origin, np.subtract(bar.end, bar.start)
    length = float(np.linalg.norm(axis))
    axis = axis / length
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.linalg.norm(side)
    frame = np.column_stack([side, np.cross(axis, side), axis, start])
    radius = bar.radius / np.cos(np.pi / SIDES)
    return Manifold.cylinder(length, radius, radius, SIDES).transform(frame)


def _read_mesh(path: Path, part: Part, origin: Floats) -> Any:
    from damageest.geometry.solids import to_manifold
    from damageest.io.parts import read_part

    try:
        solid: Solid = read_part(path, part.unit)
        return to_manifold(solid, origin)
    except (DamageestError, ValueError, OSError) as error:
        raise StageError(f"keep_out: {path}: {error}", "give a watertight STL, PLY, OBJ, OFF or 3MF file") from None
