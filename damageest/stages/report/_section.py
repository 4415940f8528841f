"""Sections through sites, and the histogram of deviations, as SVG that takes its colours from the page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from damageest.artefacts import INTACT, Floats, Mesh
from damageest.geometry.solids import to_manifold
from damageest.io import colours
from damageest.io.section_files import Drawing as Layout
from damageest.io.section_files import round_nice
from damageest.result import Result, Site
from damageest.stages.report._svg import GROUND, INK, METAL, NO_FILL, SOFT, Drawing, choose_ticks
from damageest.stages.report._words import ENGLISH_WORDS, Words

MOST_POINTS = 700
"""Scan points of a drawing."""
WIDTH, HEIGHT, FLAT = 460, 302, 216
"""Size of a section in pixels, and the height of the histogram."""
MARGINS = (44, 40, 8, 8)
"""Of the histogram, in pixels: left, bottom, right, top."""
FONT = "font:9px system-ui, sans-serif"


@dataclass(frozen=True)
class Plane:
    """A plane through ``origin`` (3,): ``along`` (3,) goes to the right of the drawing, ``out`` (3,) to its top, away
    from the metal, and ``across`` (3,) to the viewer."""

    origin: Floats
    along: Floats
    out: Floats
    across: Floats

    def project(self, points: Floats) -> tuple[Floats, Floats]:
        """Points (N,3) in the drawing (N,2), and their distance (N,) from the plane."""
        local = points - self.origin
        return np.stack([local @ self.along, local @ self.out], axis=1), local @ self.across


def choose_plane(result: Result, site: Site) -> Plane:
    """The plane through the site's deepest point that cuts the inner surface there squarely.

    It contains the direction that the inner surface faces there, or where there is none the skin's normal; and of the
    directions square to that and nearest to the part's axes the one in which the site is longest.
    """
    points = site.points
    place, skin = site.centroid, np.zeros(3)
    if len(points):
        deepest = points[int(result.deviation.distance[points].argmin())]
        place, skin = result.aligned.points[deepest], result.part.face_normals[result.deviation.face[deepest]]
    if len(site.surface.faces):  # averaged, because it is as rough as the scan
        far = np.linalg.norm(site.surface.triangles.mean(axis=1) - place, axis=1)
        reach = far.min() + 0.2 * site.damage.diagonal
        out = (np.exp(-((far / reach) ** 2))[:, None] * site.surface.cross).sum(axis=0)
        skin = out / np.linalg.norm(out) if np.linalg.norm(out) > 0 else skin
    out = _snap(skin)
    axes = np.eye(3) - np.outer(out, out)
    length = np.linalg.norm(axes, axis=1)
    axes = axes[length > 0.5] / length[length > 0.5, None]
    extent = np.ptp(site.damage.vertices @ axes.T, axis=0)
    along = axes[int(extent.argmax())]
    return Plane(place, along, out, np.cross(along, out))


def _snap(direction: Floats) -> Floats:
    """The axis of the part within 20 degrees of a unit vector (3,), else the vector; z for one of no length."""
    nearest = int(np.abs(direction).argmax())
    if abs(direction[nearest]) > np.cos(np.radians(20)):
        return np.asarray(np.eye(3)[nearest] * np.sign(direction[nearest]))
    return direction if np.linalg.norm(direction) > 0.5 else np.array([0.0, 0.0, 1.0])


def draw_section(result: Result, site: Site, plane: Plane, part: Any) -> tuple[str, float]:
    """The section as SVG, and the largest distance from the plane of the scan points that it shows.

    ``part``: as `to_manifold` gives it, from the centre of the part's bounds.
    """
    flat, _ = plane.project(site.damage.vertices)
    low, high = flat.min(axis=0), flat.max(axis=0)
    margin = 0.22 * float((high - low).max()) + 4 * result.tolerance
    low, high = np.minimum(low, 0) - margin, np.maximum(high, 0) + margin
    low, high = _widen(low, high, WIDTH / HEIGHT)
    drawing = Drawing(f"section-{site.id}", WIDTH, HEIGHT, low, high)
    outlines = _cut(part, plane, result.part.bounds.mean(axis=0))
    label = "adapted-part" if result.adapted else "part-as-designed"
    drawing.fill(label, outlines, f"fill:{METAL};stroke:{INK};stroke-width:1.1")
    origin = site.damage.bounds.mean(axis=0)
    colour = colours.colour_site(site.id)
    if site.deposit is not None:
        loops = _cut(to_manifold(site.deposit, origin), plane, origin)
        drawing.fill("deposit", loops, f"{NO_FILL};stroke:{colours.DEPOSIT};stroke-width:1.2;stroke-dasharray:4.4 1.9")
    lost = _cut(to_manifold(site.damage, origin), plane, origin)
    drawing.fill("lost", lost, f"fill:{GROUND}")
    drawing.fill("damage-volume", lost, f"fill:{colour};fill-opacity:.35;stroke:{colour};stroke-width:.8")
    line = f"stroke:{colour};stroke-width:1.8;stroke-linecap:round"
    drawing.draw_lines("inner-damage-surface", _cut_surface(site.surface, plane), line)
    points, slab = _choose_points(result, plane, low, high)
    drawing.draw_points("scan-points", points, 0.85, f"fill:{INK}")
    arm = 4.5 / drawing.scale
    cross = np.array([[-arm[0], 0], [arm[0], 0], [np.nan, np.nan], [0, -arm[1]], [0, arm[1]]])
    drawing.draw_lines("deepest-point", cross, f"stroke:{INK};stroke-width:1.2")
    _draw_ruler(drawing, low, high, result.units)
    return drawing.to_svg(), slab


def lay_out_site(result: Result, site: Site) -> Layout | None:
    """The section through a site's deepest point on paper, for a PDF: the part, the damage volume, and scan points as
    short lines. None where the plane meets neither."""
    plane = choose_plane(result, site)
    origin = site.damage.bounds.mean(axis=0)
    lost = _cut(to_manifold(site.damage, origin), plane, origin)
    middle = result.part.bounds.mean(axis=0)
    part = _cut(to_manifold(result.part, middle), plane, middle)
    if not lost or not part:
        return None
    ends = np.vstack(lost)
    low, high = ends.min(axis=0), ends.max(axis=0)
    margin = 0.3 * float((high - low).max()) + 4 * result.tolerance
    low, high = _widen(low - margin, high + margin, WIDTH / HEIGHT)
    width, height = 480.0, 480.0 * HEIGHT / WIDTH
    scale = width / (high[0] - low[0])

    def place(points: Floats) -> Floats:
        return np.asarray(np.array([0.0, height]) + scale * (points - low) * np.array([1.0, -1.0]))

    from manifold3d import CrossSection

    frame = CrossSection([np.array([low, [high[0], low[1]], high, [low[0], high[1]]])])
    shown = [(CrossSection([loop[:-1] for loop in loops]) ^ frame).to_polygons() for loops in (part, lost)]
    areas, damage = ([place(np.vstack([loop, loop[:1]])) for loop in loops] for loops in shown)
    slab = max(float(result.scan.spacing), 0.5 * result.tolerance)
    flat, off = plane.project(result.aligned.points)
    near = (np.abs(off) <= slab) & ((flat > low) & (flat < high)).all(axis=1)
    points = place(flat[near])
    points = points[:: max(1, -(-len(points) // MOST_POINTS))]
    dots = [("within", point + np.array([[-0.7, 0.0], [0.7, 0.0]])) for point in points]
    length = round_nice(0.25 * (high[0] - low[0]))
    ruler = np.array([[10.0, height + 9.0], [10.0 + scale * length, height + 9.0]])
    lines = [*(("above", loop) for loop in damage), *dots]
    text = f"{length:g} {result.units}"
    return Layout((width, height + 18.0), 1.0, tuple(areas), tuple(areas), (), tuple(lines), (), (ruler, text))


def draw_histogram(result: Result, words: Words = ENGLISH_WORDS) -> str:
    """How far the intact points are from the skin, with the tolerance and the noise of the scan."""
    distance = result.deviation.distance[result.deviation.label == INTACT]
    reach = 1.25 * result.tolerance
    count, edges = np.histogram(distance, bins=np.linspace(-reach, reach, 81))
    share = count / max(count.sum(), 1) * 100
    top = max(1.05 * float(share.max()), 1e-9)
    drawing = Drawing("histogram", WIDTH, FLAT, (-reach, 0), (reach, top), MARGINS)
    noise = result.scan.noise
    if 0 < noise < reach:
        drawing.fill("noise", [_box(-noise, noise, top)], f"fill:{SOFT};fill-opacity:.25")
    steps = np.column_stack([np.repeat(edges, 2), np.concatenate([[0], np.repeat(share, 2), [0]])])
    drawing.fill("counts", [steps], "fill:#4f86c6;fill-opacity:.75")
    for sign in (-1, 1):
        limit = np.array([[sign * result.tolerance, 0], [sign * result.tolerance, top]])
        drawing.draw_lines(f"tolerance-{sign}", limit, "stroke:#d1495b;stroke-width:1.3;stroke-dasharray:4.8 2.1")
    _draw_axes(drawing, reach, top)
    centred = f"fill:{INK};text-anchor:middle;{FONT}"
    drawing.write(
        words.tell("signed distance to the nominal surface, {unit}", unit=result.units), (0, 0), (0, 31), centred
    )
    drawing.turn_to_side(words.tell("intact points, %"), centred)
    return drawing.to_svg()


def _draw_axes(drawing: Drawing, reach: float, top: float) -> None:
    """The frame of the histogram, with round values along two of its sides."""
    frame = np.vstack([_box(-reach, reach, top), [[-reach, 0]]])
    line = f"stroke:{SOFT};stroke-width:.8"
    drawing.draw_lines("frame", frame, line)
    for x in choose_ticks(-reach, reach, 6):
        drawing.write(f"{x + 0.0:.6g}".replace("-", "−"), (x, 0), (0, 14), f"fill:{INK};text-anchor:middle;{FONT}")
        drawing.draw_tick((x, 0), (0, 4), line)
    for y in choose_ticks(0, top, 4):
        drawing.write(f"{y:.6g}", (-reach, y), (-7, 3), f"fill:{INK};text-anchor:end;{FONT}")
        drawing.draw_tick((-reach, y), (-4, 0), line)


def _box(left: float, right: float, top: float) -> Floats:
    """The corners (4,2) of a rectangle that stands on zero."""
    return np.array([[left, 0], [left, top], [right, top], [right, 0]])


def _widen(low: Floats, high: Floats, ratio: float) -> tuple[Floats, Floats]:
    """Limits of the same centre whose width is ``ratio`` times their height."""
    centre, half = (low + high) / 2, (high - low) / 2
    half = np.array([max(half[0], half[1] * ratio), max(half[1], half[0] / ratio)])
    return centre - half, centre + half


def _cut(body: Any, plane: Plane, origin: Floats) -> list[Floats]:
    """The closed outlines of a body, given from ``origin``, in a plane."""
    turn = np.stack([plane.along, plane.out, plane.across])
    shift = turn @ (origin - plane.origin)
    loops = body.transform(np.column_stack([turn, shift])).slice(0.0).to_polygons()
    return [np.vstack([loop, loop[:1]]) for loop in loops]


def _cut_surface(surface: Mesh, plane: Plane) -> Floats:
    """Where an open mesh crosses the plane: pieces of a line in the drawing (N,2), with NaN between them."""
    if not len(surface.faces):
        return np.zeros((0, 2))
    corners = surface.triangles
    height = (corners - plane.origin) @ plane.across
    above = height > 0
    crossed = above.any(axis=1) & ~above.all(axis=1)
    corners, height, above = corners[crossed], height[crossed], above[crossed]
    lone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
    row = np.arange(len(corners))
    ends = []
    for step in (1, 2):
        other = (lone + step) % 3
        share = (height[row, lone] / (height[row, lone] - height[row, other]))[:, None]
        ends.append(plane.project(corners[row, lone] * (1 - share) + corners[row, other] * share)[0])
    gap = np.full((len(corners), 1, 2), np.nan)  # so that all pieces are one line
    return np.concatenate([np.stack(ends, axis=1), gap], axis=1).reshape(-1, 2)


def _choose_points(result: Result, plane: Plane, low: Floats, high: Floats) -> tuple[Floats, float]:
    """The scan points near the plane, in the drawing (N,2), and how near they are."""
    slab = max(float(result.scan.spacing), 0.5 * result.tolerance)
    off = np.abs(result.aligned.points @ plane.across - plane.origin @ plane.across)
    near = np.flatnonzero(off <= slab)
    flat, _ = plane.project(result.aligned.points[near])
    inside = ((flat > low) & (flat < high)).all(axis=1)
    flat, off = flat[inside], off[near[inside]]
    if len(off) > MOST_POINTS:
        slab = float(np.partition(off, MOST_POINTS - 1)[MOST_POINTS - 1])
    return flat[off <= slab], slab


def _draw_ruler(drawing: Drawing, low: Floats, high: Floats, unit: str) -> None:
    """A ruler of a round length at the bottom left, with a mark at each tenth of it."""
    width, height = high - low
    length = round_nice(0.3 * width)
    x, y, tick = low[0] + 0.03 * width, low[1] + 0.04 * height, 0.012 * height
    line = [(x, y + 2 * tick), (x, y), (x + length, y), (x + length, y + 2 * tick)]
    for k in range(1, 10):
        line += [(np.nan, np.nan), (x + k * length / 10, y), (x + k * length / 10, y + (1.6 if k == 5 else 1) * tick)]
    drawing.draw_lines("ruler", np.array(line), f"stroke:{INK};stroke-width:1.2")
    for at, words in ((x + length, f"{length:g} {unit}"), (x, "0")):
        drawing.write(words, (at, y + 3 * tick), (0, 0), f"fill:{INK};text-anchor:middle;{FONT}")
