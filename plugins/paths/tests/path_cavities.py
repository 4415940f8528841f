"""Cavities with curved floors of known shape, cut into parts, and what the planner needs to know of them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.fill.stripes import Bead
from damageest_paths.layering.planar import Surroundings
from damageest_paths.process.frames import Frame, make_frame
from damageest_paths.process.process import Process
from damageest_paths.sheets.floor import Floor, list_floors
from damageest_paths.tool.nozzle import Cone, make_nozzle
from manifold3d import CrossSection, Manifold

from damageest.geometry.solids import to_manifold, to_solid
from tests.path_shapes import BLOCK, Loss, cut

BORE, DEPTH, LONG = 20.0, 3.0, 8.0
"""Radius of the bore, depth of its groove, length of the half shell."""
BALL, SUNK = 12.0, 3.0
"""Radius of a ball, and how deep its mark is."""


def groove(half: float = 50.0) -> Loss:
    """A half shell about the y axis, its bore worn evenly by DEPTH up to angles of ``half`` degrees to both sides."""
    ring = CrossSection.circle(2 * BORE, 256) - CrossSection.circle(BORE, 256)
    shell = (ring ^ CrossSection.square((100.0, 50.0)).translate((-50.0, -50.0))).extrude(LONG)
    angle = np.radians(np.linspace(-half, half, 65) - 90)
    arc = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    tool = CrossSection([np.concatenate([(BORE + DEPTH) * arc, (BORE - 2) * arc[::-1]])]).extrude(LONG)
    return cut(*(_lay(body) for body in (shell, tool)))


def _lay(body: Any) -> Any:
    """A body with its axis along z, turned so that it is along y, its middle at 0."""
    return body.translate((0, 0, -LONG / 2)).rotate((90, 0, 0))


def bowl() -> Loss:
    """The mark of a ball in the top of a block."""
    return cut(BLOCK, Manifold.sphere(BALL, 160).translate((0, 0, BALL - SUNK)))


def pocket() -> Loss:
    """A pocket with upright walls and a flat floor, 4 deep."""
    return cut(BLOCK, Manifold.cube((18, 12, 9)).translate((-9, -6, -4)))


def stair() -> Loss:
    """A pocket whose floor has a step higher than a bead."""
    tool = Manifold.cube((9, 12, 12)).translate((-9, -6, -8)) + Manifold.cube((9, 12, 12)).translate((0, -6, -3))
    return cut(BLOCK, tool)


def ledge() -> Loss:
    """A pocket 6 deep with a ledge of 4 by 0.6 on one wall, 2 deep, as scans leave them."""
    tool = Manifold.cube((18, 12, 12)).translate((-9, -6, -6)) + Manifold.cube((4, 1.6, 12)).translate((-2, 5, -2))
    return cut(BLOCK, tool)


def low_stair() -> Loss:
    """A pocket whose floor has a step of 2, an eighth of it higher."""
    tool = Manifold.cube((28, 12, 12)).translate((-16, -6, -4)) + Manifold.cube((4, 12, 12)).translate((12, -6, -2))
    return cut(BLOCK, tool)


def crescent(radius: float, long: float) -> Loss:
    """A shaft about the y axis that is worn on its upper side, by 1 at most: the floor is round up to its border."""
    shaft, left = (_lay(Manifold.cylinder(long, radius, radius, 256)).translate((0, 0, z)) for z in (0, -1))
    return cut(shaft, Manifold.cube((60, 60, 60), True) - left)


def funnel() -> Loss:
    """A pocket 3 deep with a flat floor, whose walls lean by 12 degrees."""
    half = np.array([9.0, 6.0])
    wider = 1 + 4 * np.tan(np.radians(12)) / half
    floor = CrossSection.square(tuple(2 * half), True)
    return cut(BLOCK, Manifold.extrude(floor, 4, 0, 0, tuple(wider)).translate((0, 0, -3)))


def tip() -> Loss:
    """The tip of a blade, its end round about the y axis and its stub round too."""
    x = np.linspace(-1, 1, 41)
    outline = np.concatenate(
        [np.column_stack([9 * x, 2.2 * (1 - x**2) + 0.5]), np.column_stack([9 * x, -2.2 * (1 - x**2) - 0.5])[::-1]]
    )
    blade = Manifold.extrude(CrossSection([outline[::-1]]), 40)
    end, stub = (Manifold.cylinder(60, radius, radius, 256, True).rotate((90, 0, 0)) for radius in (30, 26))
    return cut(blade ^ end, Manifold.cube((100, 100, 100), True) - stub)


class Scene(NamedTuple):
    body: Any
    around: Surroundings
    frame: Frame
    floor: Floor
    process: Process


NOZZLE = make_nozzle(Cone(1.0, 8.0, 40.0, float(np.radians(20.0))))


def make_process(**options: Any) -> Process:
    """Beads 2 wide and 1 high for a tool that tilts by 60 degrees, with other ``options``."""
    values: dict[str, Any] = {
        "height": 1.0, "bead": Bead(2.0, 1.4), "pattern": "zigzag", "angle": 0.0, "turn": np.pi / 2,
        "overhang": np.pi / 4, "shortest": 0.0, "gap": 0.5, "axes": 5, "tilt": np.radians(60.0),
        "turn_rate": np.radians(10.0),
    }  # fmt: skip
    return Process(**{**values, **options})


def prepare(loss: Loss, **options: Any) -> Scene:
    """A loss as the planner is given it, built up along z."""
    origin = loss.lost.bounds.mean(axis=0)
    body, metal = to_manifold(loss.lost, origin), to_manifold(loss.left, origin)
    process, frame = make_process(**options), make_frame((0.0, 0.0, 1.0), origin)
    floor = next(list_floors(frame.move(body), frame.move(metal), process))[0]
    return Scene(body, Surroundings(metal, (), Clearance(NOZZLE, 3.0)), frame, floor, process)


def stand(body: Any) -> float:
    """The volume of a Manifold as a solid."""
    solid = to_solid(body)
    return 0.0 if solid is None else solid.volume
