"""Parts with a known loss, and options of a nozzle that fits them."""

from __future__ import annotations

from typing import Any, NamedTuple

from damageest_paths.layers import Layers
from manifold3d import Manifold

from damageest.artefacts import DepositPath, Solid
from damageest.geometry.solids import to_solid

NOZZLE = {"tip_radius": 1.0, "cone_angle": 25.0, "length": 60.0, "body_radius": 12.0}
OPTIONS: dict[str, Any] = {
    "height": 1.0, "width": 2.0, "feed": 600.0, "standoff": 3.0, "nozzle": NOZZLE, "layers": "planar"
}  # fmt: skip
TOLERANCE = 0.05


class Loss(NamedTuple):
    """``lost``: what is missing; ``left``: what is left of the part."""

    lost: Solid
    left: Solid


def cut(part: Any, tool: Any) -> Loss:
    lost, left = to_solid(part ^ tool), to_solid(part - tool)
    assert lost is not None
    assert left is not None
    return Loss(lost, left)


BLOCK = Manifold.cube((40, 30, 20)).translate((-20, -15, -20))


def dent() -> Loss:
    """A shallow dent in the top of a block, open upward."""
    return cut(BLOCK, Manifold.sphere(14, 64).translate((0, 0, 10)))


def corner() -> Loss:
    return cut(BLOCK, Manifold.cube((16, 14, 9)).translate((10, 6, -6)))


def slot() -> Loss:
    """A deep slot with upright walls, open upward and to both sides."""
    return cut(BLOCK, Manifold.cube((8, 60, 24)).translate((-4, -30, -12)))


def plan(loss: Loss, **options: Any) -> DepositPath:
    path = Layers(**{**OPTIONS, **options}).run(body=loss.lost, left=loss.left, built=None, tolerance=TOLERANCE)
    assert path is not None
    return path
