"""A section through a site as a drawing (SVG), on which distances are measured by two clicks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh

WIDTH, HEIGHT = 640.0, 420.0
"""Size of a drawing, in its own units."""
MOST_POINTS = 2500
NORMALS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane through ``origin`` (3,); ``right``, ``up`` and ``normal`` (3,) are unit vectors."""

    origin: Floats
    right: Floats
    up: Floats
    normal: Floats

    def shift(self, offset: float) -> Plane:
        return replace(self, origin=self.origin + offset * self.normal)

    def project(self, points: Floats) -> tuple[Floats, Floats]:
        """Points (N,3) in the plane (N,2), and their distance (N,) from it."""
        local = points - self.origin
        return np.stack([local @ self.right, local @ self.up], axis=1), local @ self.normal

    def lift(self, flat: Floats) -> Floats:
        """Points (N,2) of the plane in space (N,3)."""
        return np.asarray(self.origin + flat[:, :1] * self.right + flat[:, 1:2] * self.up)


def choose_plane(damage: Mesh, surface: Mesh | None, axis: str = "auto") -> Plane:
    """A plane through the middle of a site. ``auto``: it holds the direction out of the metal, which is the drawing's
    top, and the longest extent of the site; else the plane square to an axis of the part."""
    middle = damage.bounds.mean(axis=0)
    if axis in NORMALS:
        normal = np.array(NORMALS[axis])
        up = np.array(NORMALS["y" if axis == "z" else "z"])
        return Plane(middle, np.cross(up, normal), up, normal)
    out = surface.cross.sum(axis=0) if surface is not None and len(surface.faces) else np.array([0.0, 0.0, 1.0])
    length = float(np.linalg.norm(out))
    out = out / length if length > 0 else np.array([0.0, 0.0, 1.0])
    nearest = int(np.abs(out).argmax())
    if abs(out[nearest]) > np.cos(np.radians(20)):
        out = np.eye(3)[nearest] * np.sign(out[nearest])
    axes = np.eye(3) - np.outer(out, out)
    size = np.linalg.norm(axes, axis=1)
    axes = axes[size > 0.5] / size[size > 0.5, None]
    right = axes[int(np.ptp(damage.vertices @ axes.T, axis=0).argmax())]
    return Plane(middle, right, out, np.cross(right, out))


def measure_depth(damage: Mesh, plane: Plane) -> float:
    """How far the site reaches on either side of its plane: the range of a slider."""
    return float(np.abs((damage.vertices - plane.origin) @ plane.normal).max())


class Cutter:
    """A mesh that is cut by many planes. It need not be closed: files in single precision may not be."""

    def __init__(self, mesh: Mesh) -> None:
        import trimesh

        self._body = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)

    def cut(self, plane: Plane) -> list[Floats]:
        """The outlines (K,2) in the plane."""
        outline = self._body.section(plane.normal, plane.origin)
        if outline is None:
            return []
        axes = np.stack([plane.right, plane.up], axis=1)
        return [(np.asarray(line) - plane.origin) @ axes for line in outline.discrete]


@dataclass(frozen=True)
class Drawing:
    """An SVG element and the frame that it shows: ``low`` is its left lower corner, ``scale`` drawing units for
    a length."""

    svg: str
    low: tuple[float, float]
    scale: float

    def to_plane(self, x: float, y: float) -> tuple[float, float]:
        """A place of the drawing, from its left upper corner, in the plane."""
        return self.low[0] + x / self.scale, self.low[1] + (HEIGHT - y) / self.scale


def draw(
    plane: Plane,
    loops: dict[str, list[Floats]],
    points: Floats,
    spacing: float,
    unit: str,
    colour: str,
    measured: list[tuple[float, float]] | None = None,
) -> Drawing:
    """``loops``: outlines by name (part, damage, deposit); the damage decides what is shown. ``points`` (N,3): the
    scan; those within ``spacing`` of the plane are drawn. ``measured``: up to two places in the plane."""
    shown = loops.get("damage") or loops.get("part") or [np.zeros((1, 2))]
    ends = np.concatenate(shown)
    low, high = ends.min(axis=0), ends.max(axis=0)
    half = np.maximum((high - low) * 0.72, 1e-9)
    half = np.array([max(half[0], half[1] * WIDTH / HEIGHT), max(half[1], half[0] * HEIGHT / WIDTH)])
    centre = (low + high) / 2
    scale = float(WIDTH / (2 * half[0]))
    corner = centre - half

    def place(flat: Floats) -> Floats:
        moved = (flat - corner) * scale
        return np.column_stack([moved[:, 0], HEIGHT - moved[:, 1]])

    pieces = [
        f'<svg viewBox="0 0 {WIDTH:g} {HEIGHT:g}" class="section" role="img" aria-label="section through the site">'
    ]
    looks = {
        "part": 'class="metal"',
        "deposit": 'class="deposit"',
        "damage": f'class="damage" style="fill:{colour};stroke:{colour}"',
    }
    for name, look in looks.items():
        if loops.get(name):
            pieces.append(f'<path {look} fill-rule="evenodd" d="{"".join(_path(place(one)) for one in loops[name])}"/>')
    flat, off = plane.project(points)
    flat = flat[np.abs(off) <= spacing]
    flat = flat[(np.abs(flat - centre) < half).all(axis=1)]
    flat = flat[:: max(1, len(flat) // MOST_POINTS)]
    dots = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in place(flat)) if len(flat) else ""
    pieces.append(f'<path class="points" d="{dots}"/>')
    pieces.append(_draw_ruler(2 * half[0], scale, unit))
    if measured:
        pieces.append(_draw_measured(place(np.array(measured)), measured, unit))
    return Drawing("".join(pieces) + "</svg>", (float(corner[0]), float(corner[1])), scale)


def _path(loop: Floats) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in loop) + "Z"


def _draw_ruler(width: float, scale: float, unit: str) -> str:
    raw = 0.25 * width
    power = 10.0 ** np.floor(np.log10(raw))
    length = float(max(step * power for step in (1, 2, 5) if step * power <= raw * 1.0001))
    x, y, end = 18.0, HEIGHT - 16, 18 + length * scale
    line = f'<path class="ruler" d="M{x} {y - 6}V{y}H{end:.1f}V{y - 6}"/>'
    return f'{line}<text x="{(x + end) / 2:.1f}" y="{y - 8}" text-anchor="middle">{length:g} {unit}</text>'


def _draw_measured(places: Floats, measured: list[tuple[float, float]], unit: str) -> str:
    marks = "".join(f'<circle class="mark" cx="{x:.1f}" cy="{y:.1f}" r="4"/>' for x, y in places)
    if len(measured) < 2:
        return marks
    (a, b), (c, d) = places[:2]
    length = float(np.hypot(measured[1][0] - measured[0][0], measured[1][1] - measured[0][1]))
    line = f'<path class="mark" d="M{a:.1f} {b:.1f}L{c:.1f} {d:.1f}"/>'
    label = f'<text class="length" x="{(a + c) / 2:.1f}" y="{(b + d) / 2 - 8:.1f}" text-anchor="middle">'
    return f"{marks}{line}{label}{length:.4g} {unit}</text>"


def to_space(plane: Plane, loops: list[Floats]) -> list[Any]:
    """Outlines of the plane as lines in space."""
    return [plane.lift(loop) for loop in loops]
