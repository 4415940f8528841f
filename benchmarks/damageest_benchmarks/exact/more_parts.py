"""More parts made by CadQuery, for the measurement on files: what machined, turned, cast and sheet parts have."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np


def _box(x: float, y: float, z: float) -> Any:
    import cadquery as cq

    return cq.Workplane().box(x, y, z)


def _turned(*profile: tuple[float, float], angle: float = 360.0) -> Any:
    """A body of revolution about z; ``profile``: radius and height of its corners."""
    import cadquery as cq

    return cq.Workplane("XZ").polyline(profile).close().revolve(angle, (0, 0, 0), (0, 1, 0))


def _prism(height: float, *points: tuple[float, float]) -> Any:
    import cadquery as cq

    return cq.Workplane().polyline(points).close().extrude(height)


def _swept(section: Callable[[Any], Any], *points: tuple[float, float, float]) -> Any:
    import cadquery as cq

    path = cq.Workplane().spline(list(points))
    plane = cq.Plane(points[0], (0, 1, 0), np.subtract(points[1], points[0]).tolist())
    return section(cq.Workplane(plane)).sweep(path)


def _make_lug() -> Any:
    import cadquery as cq

    eye = cq.Workplane().circle(18).extrude(12).faces(">Z").workplane().hole(16)
    return _box(50, 24, 12).translate((-30, 0, 6)).union(eye).cut(cq.Workplane().circle(8).extrude(12))


def _make_counterbored() -> Any:
    body = _box(60, 40, 20).faces(">Z").workplane()
    return body.rarray(32, 1, 2, 1).cboreHole(6, 11, 5).faces(">Z").workplane().cskHole(6, 14, 82)


def _make_fading_fillet() -> Any:
    import cadquery as cq

    body = _box(50, 30, 16).union(cq.Workplane().circle(13).extrude(22))
    return body.edges(cq.selectors.BoxSelector((-14, -14, 7), (14, 14, 9))).fillet(3)


def _make_pipe() -> Any:
    return _swept(lambda plane: plane.circle(7).circle(5), (0, 0, 0), (0, 0, 25), (15, 0, 45), (40, 10, 50))


def _make_bar() -> Any:
    return _swept(lambda plane: plane.rect(12, 8), (0, 0, 0), (20, 4, 0), (45, -4, 3), (70, 0, 0))


def _make_dome() -> Any:
    import cadquery as cq

    shell = cq.Workplane().sphere(25).cut(cq.Workplane().sphere(20)).cut(_box(60, 60, 30).translate((0, 0, -15)))
    return shell.union(cq.Workplane().circle(30).circle(19).extrude(5))


def _make_cam() -> Any:
    import cadquery as cq

    t = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    radius = 22 + 6 * np.cos(t) + 2 * np.cos(2 * t)
    points = list(zip((radius * np.cos(t)).tolist(), (radius * np.sin(t)).tolist(), strict=True))
    return cq.Workplane().spline(points, periodic=True).close().extrude(14).faces(">Z").workplane().hole(14)


def _make_wave() -> Any:
    import cadquery as cq

    points = [[cq.Vector(x, y, 14 + 3 * np.sin(x / 12) * np.cos(y / 10)) for x in range(-36, 37, 8)]
              for y in range(-26, 27, 4)]  # fmt: skip
    top = cq.Face.makeSplineApprox(points, tol=1e-3)
    return _box(60, 40, 40).split(cq.Workplane(obj=top)).solids("<Z")


def _make_shelled() -> Any:
    return _box(60, 40, 25).edges("|Z").fillet(8).faces(">Z").shell(-3)


def _make_thread_end() -> Any:
    return _turned((0, 0), (10, 0), (10, 20), (8.2, 22), (8.2, 24), (11, 26), (11, 45), (9.5, 46.5), (0, 46.5))


def _make_cross_drilled() -> Any:
    import cadquery as cq

    return cq.Workplane().circle(15).extrude(60).cut(cq.Workplane("XZ").center(0, 30).circle(6).extrude(40, both=True))


def _make_hollow_cone() -> Any:
    return _turned((14, 0), (20, 0), (10, 50), (6, 50))


def _make_wheel() -> Any:
    import cadquery as cq

    rim = cq.Workplane().circle(34).circle(27).extrude(12)
    for k in range(5):
        rim = rim.union(_box(24, 6, 8).translate((18, 0, 6)).rotate((0, 0, 0), (0, 0, 1), 72 * k))
    return rim.union(cq.Workplane().circle(10).extrude(12)).cut(cq.Workplane().circle(5).extrude(12))


def _make_ball_joint() -> Any:
    import cadquery as cq

    return cq.Workplane().circle(6).extrude(40).union(cq.Workplane().sphere(11).translate((0, 0, 44))).edges().fillet(1)


def _make_keyed_hub() -> Any:
    import cadquery as cq

    hub = cq.Workplane().circle(22).extrude(18).faces(">Z").chamfer(2).faces(">Z").workplane().hole(20)
    return hub.cut(_box(6, 26, 40))


def _make_u_channel() -> Any:
    body = _box(70, 34, 30).cut(_box(70, 24, 25).translate((0, 0, 5)))
    return body.edges("|X and <Z").fillet(4)


def _make_pocketed() -> Any:
    pocket = _box(40, 24, 14).edges("|Z").fillet(5).faces("<Z").edges().fillet(2)
    return _box(60, 40, 20).cut(pocket.translate((0, 0, 6)))


def _make_twist() -> Any:
    import cadquery as cq

    return cq.Workplane().rect(24, 14).twistExtrude(50, 60)


def _make_ellipse() -> Any:
    import cadquery as cq

    return cq.Workplane().ellipse(26, 14).extrude(24).faces(">Z").edges().fillet(3)


def _make_torus_groove() -> Any:
    import cadquery as cq

    ring = cq.Workplane("XZ").center(16, 15).circle(3).revolve(360, (-16, 0, 0), (-16, 1, 0))
    return cq.Workplane().circle(17).extrude(30).cut(ring)


PARTS: dict[str, Callable[[], Any]] = {
    "plain_block": lambda: _box(60, 40, 20),
    "chamfered_block": lambda: _box(60, 40, 20).edges().chamfer(3),
    "round_block": lambda: _box(60, 40, 24).edges().fillet(6),
    "wedge": lambda: _prism(30, (0, 0), (60, 0), (60, 12), (0, 28)),
    "hexagon": lambda: _prism(18, *((22 * np.cos(k * np.pi / 3), 22 * np.sin(k * np.pi / 3)) for k in range(6))),
    "star": lambda: _prism(
        14, *(((30, 14)[k % 2] * np.cos(k * np.pi / 6), (30, 14)[k % 2] * np.sin(k * np.pi / 6)) for k in range(12))
    ),
    "shaft": lambda: _turned((0, 0), (9, 0), (9, 30), (14, 30), (14, 55), (0, 55)),
    "half_ring": lambda: _turned((20, 0), (32, 0), (32, 8), (26, 14), (20, 14), angle=180.0),
    "flange": lambda: _turned((8, 0), (34, 0), (34, 8), (14, 8), (12, 34), (8, 34)),
    "hollow_cone": _make_hollow_cone,
    "thread_end": _make_thread_end,
    "lug": _make_lug,
    "counterbored": _make_counterbored,
    "fading_fillet": _make_fading_fillet,
    "pipe": _make_pipe,
    "bar": _make_bar,
    "dome": _make_dome,
    "cam": _make_cam,
    "wave": _make_wave,
    "shelled": _make_shelled,
    "cross_drilled": _make_cross_drilled,
    "wheel": _make_wheel,
    "ball_joint": _make_ball_joint,
    "keyed_hub": _make_keyed_hub,
    "u_channel": _make_u_channel,
    "pocketed": _make_pocketed,
    "twist": _make_twist,
    "ellipse": _make_ellipse,
    "torus_groove": _make_torus_groove,
}
"""Each a function that gives a workplane with one solid."""
