"""The parts of the suite: the thirteen built-in ones, and simple ones with a wall, a pin, a rib or two bodies."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from damageest.artefacts import Part
from damageest.geometry.solids import to_arrays
from damageest_benchmarks.parts import PARTS

NOISE = 0.0005
"""Noise of a scan, as a share of the part's diagonal."""
TOLERANCE = 4.0
"""The tolerance that a job gives, as a multiple of the noise."""
WALL_HEIGHT = 15.0
PLATE = (80.0, 50.0, 6.0)
"""Edge lengths in mm of the plate that the simple parts stand on; its top is at z = 0."""
PLATE_TOLERANCE = 0.2
"""The tolerance in mm that the thickness of a wall is a multiple of; within 5 % of the tolerance of these parts."""


def _make_plate() -> Any:
    """A plate with a bore and a cut corner, so that it has no symmetry."""
    from manifold3d import Manifold

    x, y, z = PLATE
    body = Manifold.cube(PLATE, True).translate((0, 0, -z / 2))
    body -= Manifold.cylinder(3 * z, 4, 4, 96, True).translate((0.35 * x, -0.3 * y, -z / 2))
    return body - Manifold.cube((16, 16, 3 * z), True).rotate((0, 0, 45)).translate((-x / 2, y / 2, -z / 2))


def make_plate(multiple: float = 0.0) -> Part:
    """The plate alone."""
    return _to_part(_make_plate(), "plate")


def make_wall_plate(multiple: float = 4.0) -> Part:
    """The plate with an upright wall of 60 mm x 15 mm, ``multiple`` tolerances thick."""
    from manifold3d import Manifold

    wall = Manifold.cube((60, (multiple or 4.0) * PLATE_TOLERANCE, WALL_HEIGHT + 1), True)
    return _to_part(_make_plate() + wall.translate((0, 2, (WALL_HEIGHT - 1) / 2)), "wall_plate")


def make_pin_plate(multiple: float = 0.0) -> Part:
    """The plate with a pin, 4 mm across and 12 mm high, and a block beside it."""
    from manifold3d import Manifold

    pin = Manifold.cylinder(13, 2, 2, 64).translate((-15, 5, -1))
    return _to_part(_make_plate() + pin + Manifold.cube((18, 12, 10)).translate((5, 0, -1)), "pin_plate")


def make_rib_bracket(multiple: float = 0.0) -> Part:
    """An angle of two plates, stiffened by a triangular rib of 2.5 mm."""
    from manifold3d import CrossSection, Manifold

    upright = Manifold.cube((5, 50, 40), True).translate((-37.5, 0, 19))
    rib = Manifold.extrude(CrossSection([[(-36, -1), (-4, -1), (-36, 31)]]), 2.5)
    return _to_part(_make_plate() + upright + rib.rotate((90, 0, 0)).translate((0, 5, 0)), "rib_bracket")


def make_two_blocks(multiple: float = 0.0) -> Part:
    """Two separate bodies: a block with a step, and a smaller one beside it."""
    from manifold3d import Manifold

    large = Manifold.cube((50, 40, 20)) - Manifold.cube((15, 50, 10)).translate((-1, -1, 12))
    return _to_part(large + Manifold.cube((20, 30, 16)).translate((62, 0, 0)), "two_blocks")


def _to_part(body: Any, name: str) -> Part:
    vertices, faces = to_arrays(body)
    return Part(vertices, faces, unit="mm", path=name)


SIMPLE: dict[str, Callable[[float], Part]] = {
    "plate": make_plate,
    "wall_plate": make_wall_plate,
    "pin_plate": make_pin_plate,
    "rib_bracket": make_rib_bracket,
    "two_blocks": make_two_blocks,
}
"""Name of a simple part: the function that makes it; its argument is the thickness of the wall in tolerances."""
NAMES = (*PARTS, *SIMPLE)


def make_named_part(name: str, multiple: float = 0.0) -> Part:
    """A part by its name. ``multiple``: thickness in tolerances of the wall of `wall_plate`."""
    return SIMPLE[name](multiple) if name in SIMPLE else PARTS[name]()
