"""Parametric test parts of known geometry, 50 to 130 mm across, with shapes that are common in machined parts.

Curves are divided so that chords deviate by at most ``CHORD`` mm, which is below 0.0002 of any part's diagonal.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Part
from damageest.geometry.solids import to_arrays

CHORD = 0.008
"""Largest distance in mm between a curve and its chords."""


def _count_segments(radius: float) -> int:
    """Number of chords of a full circle, a multiple of 8."""
    return 8 * max(4, math.ceil(math.pi / math.acos(1 - CHORD / radius) / 8))


def _make_box(size: Sequence[float], centre: Sequence[float] = (0, 0, 0)) -> Any:
    from manifold3d import Manifold

    return Manifold.cube(tuple(size), True).translate(tuple(centre))


def _make_rod(radius: float, low: Sequence[float], high: Sequence[float]) -> Any:
    """A cylinder between two points that differ along one coordinate axis."""
    from manifold3d import Manifold

    along = int(np.argmax(np.abs(np.subtract(high, low))))
    body = Manifold.cylinder(abs(high[along] - low[along]), radius, radius, _count_segments(radius), True)
    body = body.rotate(((0, 90, 0), (90, 0, 0), (0, 0, 0))[along])
    return body.translate(tuple(np.add(low, high) / 2))


def _make_disc(radius: float, centre: Sequence[float] = (0, 0)) -> Any:
    from manifold3d import CrossSection

    return CrossSection.circle(radius, _count_segments(radius)).translate(tuple(centre))


def _make_rectangle(width: float, height: float, centre: Sequence[float] = (0, 0)) -> Any:
    from manifold3d import CrossSection

    return CrossSection.square((width, height), True).translate(tuple(centre))


def _revolve(profile: Sequence[Sequence[float]], degrees: float = 360.0) -> Any:
    """A counter-clockwise polygon of (radius, z), revolved about z."""
    from manifold3d import CrossSection, Manifold

    section = CrossSection([np.array(profile, dtype=np.float64)])
    return Manifold.revolve(section, _count_segments(float(np.max(np.array(profile)[:, 0]))), degrees)


def _to_part(body: Any, name: str) -> Part:
    vertices, faces = to_arrays(body.simplify(1e-9))
    return Part(vertices, faces, unit="mm", path=name)


def make_block() -> Part:
    """A milled block with two pockets, a slot and bores, without symmetry."""
    from manifold3d import CrossSection, JoinType, Manifold

    def make_pocket(width: float, height: float, corner: float) -> Any:
        inner = CrossSection.square((width - 2 * corner, height - 2 * corner), True)
        return inner.offset(corner, JoinType.Round, 2.0, _count_segments(corner))

    body = _make_box((80, 60, 30))
    body -= Manifold.extrude(make_pocket(34, 26, 5), 20).translate((-16, 8, 3))
    body -= Manifold.extrude(make_pocket(16, 36, 4), 20).translate((22, 4, -2))
    body -= _make_box((90, 8, 6), (0, -20, 15))
    for x, y, radius in ((-33, -12, 3), (33, 24, 3), (-2, -10, 5), (34, -12, 3.5)):
        body -= _make_rod(radius, (x, y, -20), (x, y, 20))
    body -= _make_rod(6, (-45, 8, -7), (-10, 8, -7))
    return _to_part(body, "block")


def _make_tooth(angle: float, root: float, tip: float, pitch_half: float) -> Floats:
    """One tooth's outline (2n,2), from root to tip to root, with convex flanks similar to an involute."""
    radius = np.linspace(root - 1.0, tip, 12)
    share = (radius - root) / (tip - root)
    half = pitch_half * (1.28 - 0.5 * share - 0.34 * share**2)
    left, right = angle - half, angle + half
    turn = np.concatenate([left, right[::-1]])
    radii = np.concatenate([radius, radius[::-1]])
    return np.column_stack([radii * np.cos(turn), radii * np.sin(turn)])[::-1].copy()


def make_gear() -> Part:
    """A spur gear, 80 mm across, 20 teeth, with bore, keyway and a recessed web."""
    from manifold3d import CrossSection, FillRule, Manifold

    teeth = 20
    section = _make_disc(35.0)
    for k in range(teeth):
        outline = _make_tooth(2 * math.pi * k / teeth, 35.0, 40.0, math.pi / teeth / 2)
        section += CrossSection([outline], FillRule.NonZero)
    section -= _make_disc(10.0) + _make_rectangle(6, 8, (0, 9))
    body = Manifold.extrude(section, 18).translate((0, 0, -9))
    web = Manifold.extrude(_make_disc(29.0) - _make_disc(16.0), 5)
    return _to_part(body - web.translate((0, 0, 5)) - web.translate((0, 0, -10)), "gear")


def make_half_torus() -> Part:
    """Half a torus, 100 mm across, with a flat foot on one end."""
    from manifold3d import CrossSection, Manifold

    ring = CrossSection.circle(12, _count_segments(12)).translate((38, 0))
    body = Manifold.revolve(ring, _count_segments(50), 180.0) + _make_box((30, 8, 30), (38, -4, 0))
    return _to_part(body, "half_torus")


def make_blade() -> Part:
    """A thin blade, tapered and twisted by 35 degrees, on a root with a shoulder."""
    from manifold3d import CrossSection, Manifold

    x = (1 - np.cos(np.linspace(0, np.pi, 61))) / 2
    half = 5 * 0.11 * (0.2969 * np.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4)
    camber = 0.28 * x * (1 - x)
    upper = np.column_stack([x, camber + half + 0.008])
    lower = np.column_stack([x, camber - half - 0.008])
    outline = 36 * (np.concatenate([lower, upper[::-1]]) - (0.5, 0.03))
    foil = Manifold.extrude(CrossSection([outline]), 82, 60, 35.0, (0.72, 0.72)).translate((0, 0, -2))
    root = (
        _make_box((42, 18, 6), (0, 2, -3)) + _make_box((42, 11, 8), (0, 2, -10)) + _make_box((42, 15, 6), (0, 2, -17))
    )
    return _to_part(foil + root, "blade")


def make_tube() -> Part:
    """A flanged tube with a side bore and a notch."""
    body = _revolve([(16, -45), (22, -45), (22, 35), (32, 35), (32, 45), (16, 45)])
    body -= _make_rod(6, (0, 0, 10), (40, 0, 10))
    body -= _make_box((10, 8, 30), (0, 19, -45))
    for angle in (20, 140, 260):
        x, y = 27 * math.cos(math.radians(angle)), 27 * math.sin(math.radians(angle))
        body -= _make_rod(2.25, (x, y, 30), (x, y, 50))
    return _to_part(body, "tube")


def _make_stepped_shaft() -> Any:
    """A stepped shaft with a groove."""
    left = [(0, -60), (13, -60), (14, -59), (14, -20), (18, -20), (18, 10), (15, 10)]
    right = [(15, 16), (18, 16), (18, 24), (12, 24), (12, 59), (11, 60), (0, 60)]
    return _revolve([*left, *right])


def make_shaft() -> Part:
    """A stepped shaft with a groove: a body of revolution, so that its rotation about the axis is not determined."""
    return _to_part(_make_stepped_shaft(), "shaft")


def make_keyed_shaft() -> Part:
    """The stepped shaft with a keyway in one end and a cross bore in the other."""
    body = _make_stepped_shaft() - _make_rod(3, (0, -20, 50), (0, 20, 50))
    key = (
        _make_rod(3, (0, 9, -52), (0, 20, -52))
        + _make_rod(3, (0, 9, -30), (0, 20, -30))
        + _make_box((6, 11, 22), (0, 14.5, -41))
    )
    return _to_part(body - key, "keyed_shaft")


def make_grille() -> Part:
    """A grille: a frame around bars of 4 mm that cross in two layers."""
    body = _make_box((90, 70, 12)) - _make_box((78, 58, 20))
    for x in np.linspace(-26, 26, 5):
        body += _make_box((4, 62, 6), (x, 0, -3))
    for y in np.linspace(-19, 19, 4):
        body += _make_box((82, 4, 6), (0, y, 3))
    body -= _make_rod(2.2, (-42, -32, -10), (-42, -32, 10)) + _make_rod(1.5, (42, 32, -10), (42, 32, 10))
    return _to_part(body, "grille")


def make_ribbed_plate() -> Part:
    """A plate with ribs of 3 mm, two of them crossing, and a boss with a bore."""
    body = _make_box((110, 70, 5), (0, 0, -2.5))
    body += (
        _make_box((110, 3, 18), (0, -26, 8.9))
        + _make_box((100, 3, 14), (-5, 14, 6.9))
        + _make_box((3, 60, 10), (-30, -3, 4.9))
    )
    body += _make_rod(11, (28, -6, -1), (28, -6, 16))
    body -= _make_rod(6, (28, -6, -10), (28, -6, 20))
    for x, y in ((-48, 28), (48, 28), (-48, -20)):
        body -= _make_rod(3, (x, y, -10), (x, y, 10))
    return _to_part(body, "ribbed_plate")


def make_lever() -> Part:
    """A lever: three bosses with bores on two arms at an angle, of I-shaped section."""
    from manifold3d import CrossSection, Manifold

    def make_arm(a: Sequence[float], b: Sequence[float], wide: float, narrow: float) -> Any:
        return CrossSection.batch_hull([_make_disc(wide, a), _make_disc(narrow, b)])

    pivot, far, near = (0.0, 0.0), (62.0, 6.0), (-22.0, 32.0)
    body = Manifold.extrude(make_arm(pivot, far, 11, 7) + make_arm(pivot, near, 11, 7), 10).translate((0, 0, -5))
    groove = Manifold.extrude(make_arm((18, 1.7), (48, 4.6), 5, 3.2), 4)
    body -= groove.translate((0, 0, 2.5)) + groove.translate((0, 0, -6.5))
    for (x, y), boss, height in ((pivot, 15, 13), (far, 10, 9), (near, 9, 11)):
        body += _make_rod(boss, (x, y, -height), (x, y, height))
    for (x, y), bore in ((pivot, 8), (far, 5), (near, 4)):
        body -= _make_rod(bore, (x, y, -30), (x, y, 30))
    return _to_part(body, "lever")


def make_coupling() -> Part:
    """A jaw coupling half: a hub with bore, keyway and set screw, three jaws."""
    from manifold3d import CrossSection, Manifold

    body = _revolve([(11, -28), (24, -28), (24, -10), (35, -10), (35, 4), (11, 4)])
    for k in range(3):
        turn = np.radians(120 * k + np.linspace(0, 48, 40))
        outer = 35 * np.column_stack([np.cos(turn), np.sin(turn)])
        jaw = CrossSection([np.concatenate([outer, outer[::-1] * (17 / 35)])])
        body += Manifold.extrude(jaw, 22).translate((0, 0, 3))
    body -= _make_box((6, 8, 80), (0, 10.5, 0)) + _make_rod(3, (0, 0, -20), (40, 0, -20))
    return _to_part(body, "coupling")


def make_cylinder() -> Part:
    """A plain cylinder, 40 mm across, 90 mm long."""
    return _to_part(_make_rod(20, (0, 0, -45), (0, 0, 45)), "cylinder")


def make_cuboid() -> Part:
    """A plain block with three different edge lengths."""
    return _to_part(_make_box((70, 50, 30)), "cuboid")


PARTS: dict[str, Callable[[], Part]] = {
    "block": make_block,
    "gear": make_gear,
    "half_torus": make_half_torus,
    "blade": make_blade,
    "tube": make_tube,
    "shaft": make_shaft,
    "keyed_shaft": make_keyed_shaft,
    "grille": make_grille,
    "ribbed_plate": make_ribbed_plate,
    "lever": make_lever,
    "coupling": make_coupling,
    "cylinder": make_cylinder,
    "cuboid": make_cuboid,
}
"""Name of a part: the function that makes it. Equal calls give equal parts."""


def refine(part: Part, times: int) -> Part:
    """The same part with each triangle cut into four, so many times."""
    import trimesh

    mesh = trimesh.Trimesh(part.vertices, part.faces, process=False)
    for _ in range(times):
        mesh = mesh.subdivide()
    return Part(mesh.vertices, mesh.faces, unit=part.unit, tessellation_error=part.tessellation_error)


REFINED: dict[str, Callable[[], Part]] = {
    "fine_plate": lambda: refine(make_ribbed_plate(), 1),
    "fine_blade": lambda: refine(make_blade(), 2),
    "finest_blade": lambda: refine(make_blade(), 3),
}
"""Parts with many triangles, to measure speed with."""
