"""Parts with surfaces of many kinds, made by CadQuery: each a function that gives a solid, about 80 mm long."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np


def make_filleted_block() -> Any:
    """A block with rounded edges and two holes."""
    import cadquery as cq

    body = cq.Workplane().box(70, 45, 25).edges("|Z").fillet(7).edges(">Z").fillet(2.5)
    return body.faces("<Z").workplane().pushPoints([(-18, 0), (18, 0)]).hole(11)


def make_crossing_bores() -> Any:
    """A block whose three bores meet at right angles."""
    import cadquery as cq

    body = cq.Workplane().box(60, 50, 45)
    for plane, radius in (("XY", 9), ("YZ", 7), ("XZ", 8)):
        body = body.cut(cq.Workplane(plane).circle(radius).extrude(80, both=True))
    return body


def make_gear() -> Any:
    """A spur gear of 16 trapezoidal teeth with a bore."""
    import cadquery as cq

    points = []
    for k in range(16):
        for off, radius in ((-0.28, 26), (-0.13, 34), (0.13, 34), (0.28, 26)):
            angle = 2 * np.pi * (k + off) / 16
            points.append((radius * np.cos(angle), radius * np.sin(angle)))
    return cq.Workplane().polyline(points).close().extrude(16).faces(">Z").workplane().hole(18)


def make_loft() -> Any:
    """A loft from a rectangle to a circle."""
    import cadquery as cq

    return cq.Workplane().rect(50, 34).workplane(offset=55).circle(14).loft(combine=True, ruled=False)


def make_draft() -> Any:
    """A boss with drafted sides on a plate, rounded where they meet."""
    import cadquery as cq

    plate = cq.Workplane().box(80, 50, 10)
    boss = cq.Workplane("XY").workplane(offset=5).rect(45, 28).extrude(22, taper=8)
    return plate.union(boss)


def make_blade() -> Any:
    """A twisted blade: a spline surface through three sections."""
    import cadquery as cq

    def section(scale: float, turn: float) -> list[tuple[float, float]]:
        t = np.linspace(0, 2 * np.pi, 24, endpoint=False)
        x = 20 * np.cos(t)
        y = 4.5 * np.sin(t) * (1.15 + 0.6 * np.cos(t)) + 0.006 * (400 - x**2)
        c, s = np.cos(turn), np.sin(turn)
        return [(scale * (c * a - s * b), scale * (s * a + c * b)) for a, b in zip(x, y, strict=True)]

    work = cq.Workplane().spline(section(1.0, 0.0), periodic=True).close()
    work = work.workplane(offset=30).spline(section(0.92, 0.2), periodic=True).close()
    return work.workplane(offset=30).spline(section(0.8, 0.45), periodic=True).close().loft(combine=True)


def make_helix() -> Any:
    """A shaft with a helical groove, as a worm or a feed screw has."""
    import cadquery as cq

    shaft = cq.Workplane().circle(14).extrude(70)
    path = cq.Wire.makeHelix(14, 42, 14).translate(cq.Vector(0, 0, 14))
    groove = cq.Workplane("XZ").center(14, 14).circle(3.0).sweep(cq.Workplane(path), isFrenet=True)
    return shaft.cut(groove)


def make_stepped_shaft() -> Any:
    """A shaft of three diameters with chamfers, a groove and a keyway."""
    import cadquery as cq

    profile = [
        (0, 0),
        (12, 0),
        (12, 25),
        (17, 25),
        (17, 50),
        (15, 50),
        (15, 53),
        (17, 53),
        (17, 60),
        (10, 60),
        (10, 82),
    ]
    body = cq.Workplane("XZ").polyline([*profile, (0, 82)]).close().revolve(360, (0, 0, 0), (0, 1, 0))
    return body.cut(cq.Workplane("XY").box(6, 8, 24).translate((0, 15, 38)))


def make_elbow() -> Any:
    """A tube bent by 90 degrees, with a flange."""
    import cadquery as cq

    bend = cq.Workplane().circle(14).circle(9).revolve(90, (32, 0, 0), (32, 1, 0))
    return bend.union(cq.Workplane().circle(22).circle(9).extrude(-7))


def make_sphere_cone() -> Any:
    """A cone that ends in a ball, on a torus."""
    import cadquery as cq

    cone = cq.Workplane("XY").circle(18).workplane(offset=45).circle(8).loft()
    ball = cq.Workplane().sphere(13).translate((0, 0, 50))
    ring = cq.Workplane("XZ").center(17, 4).circle(6).revolve(360, (-17, 0, 0), (-17, 1, 0))
    return cone.union(ball).union(ring)


def make_ribbed_bracket() -> Any:
    """An angle bracket with a rib and slots."""
    import cadquery as cq

    body = cq.Workplane("XZ").polyline([(0, 0), (60, 0), (60, 10), (10, 10), (10, 50), (0, 50)]).close().extrude(40)
    rib = cq.Workplane("XZ").polyline([(10, 10), (45, 10), (10, 40)]).close().extrude(8).translate((0, -16, 0))
    body = body.union(rib)
    return body.faces("<Z").workplane(origin=(42, -20, 0)).pushPoints([(0, 12), (0, -12)]).slot2D(16, 7).cutThruAll()


def make_impeller() -> Any:
    """A hub with six curved vanes."""
    import cadquery as cq

    hub = cq.Workplane().circle(38).extrude(6).union(cq.Workplane().circle(11).extrude(26))
    vane = (
        cq.Workplane().moveTo(8, -1.6).threePointArc((22, 4), (36, 14)).lineTo(34.5, 16.5)
        .threePointArc((20.5, 6.6), (8, 1.6)).close().extrude(22)
    )  # fmt: skip
    for k in range(6):
        hub = hub.union(vane.rotate((0, 0, 0), (0, 0, 1), 60 * k))
    return hub.faces(">Z").workplane().hole(10)


PARTS: dict[str, Callable[[], Any]] = {
    "filleted_block": make_filleted_block,
    "crossing_bores": make_crossing_bores,
    "gear": make_gear,
    "loft": make_loft,
    "draft": make_draft,
    "blade": make_blade,
    "helix": make_helix,
    "stepped_shaft": make_stepped_shaft,
    "elbow": make_elbow,
    "ball_cone_ring": make_sphere_cone,
    "ribbed_bracket": make_ribbed_bracket,
    "impeller": make_impeller,
}
