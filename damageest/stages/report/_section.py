"""Sections through sites, and the histogram of deviations, as SVG that takes its colours from the page."""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from damageest.artefacts import INTACT, Floats, Mesh
from damageest.geometry.solids import to_manifold
from damageest.io import colours
from damageest.io.section_files import Drawing
from damageest.result import Result, Site
from damageest.stages.report import _style as style

INK, SOFT, GROUND, METAL = "#010203", "#010204", "#010205", "#010206"
"""Placeholders in the drawings, for which the page's own colours are put."""
VARIABLES = {INK: "var(--ink)", SOFT: "var(--soft)", GROUND: "var(--ground)", METAL: "var(--metal)"}
MOST_POINTS = 700
"""Scan points of a drawing."""
WIDTH, HEIGHT, LEFT, BOTTOM = 6.4, 4.2, 0.55, 0.75
"""Size of a drawing and its margins, in inches."""


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


def draw_section(result: Result, site: Site, plane: Plane, part: Any, paper: Any) -> tuple[str, float]:
    """The section as SVG, and the largest distance from the plane of the scan points that it shows.

    ``part``: as `to_manifold` gives it, from the centre of the part's bounds. ``paper``: from `take_paper`.
    """
    figure, axes = paper
    for artist in (*axes.patches, *axes.lines, *axes.texts):
        artist.remove()
    flat, _ = plane.project(site.damage.vertices)
    low, high = flat.min(axis=0), flat.max(axis=0)
    margin = 0.22 * float((high - low).max()) + 4 * result.tolerance
    low, high = np.minimum(low, 0) - margin, np.maximum(high, 0) + margin
    low, high = _widen(low, high, WIDTH / HEIGHT)
    _fill(
        axes,
        _cut(part, plane, result.part.bounds.mean(axis=0)),
        METAL,
        INK,
        1.1,
        "adapted part" if result.adapted else "part as designed",
        1.0,
    )
    origin = site.damage.bounds.mean(axis=0)
    colour = colours.colour_site(site.id)
    if site.deposit is not None:
        loops = _cut(to_manifold(site.deposit, origin), plane, origin)
        _fill(axes, loops, "none", colours.DEPOSIT, 1.2, "deposit", 1.0, dashed=True)
    lost = _cut(to_manifold(site.damage, origin), plane, origin)
    _fill(axes, lost, GROUND, "none", 0.0, "_", 1.0)
    _fill(axes, lost, colour, colour, 0.8, "damage volume", 0.35)
    _draw_surface(axes, site.surface, plane, colour)
    slab = _draw_points(axes, result, plane, low, high)
    _add_line(axes, np.zeros((1, 2)), marker="+", color=INK, ms=9, mew=1.2, ls="none", gid="deepest-point")
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    _draw_ruler(axes, low, high, result.units)
    return _to_svg(figure, f"section-{site.id}"), slab


def lay_out_site(result: Result, site: Site) -> Drawing | None:
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
    length = style.round_nice(0.25 * (high[0] - low[0]))
    ruler = np.array([[10.0, height - 10.0], [10.0 + scale * length, height - 10.0]])
    lines = [*(("above", loop) for loop in damage), *dots]
    text = f"{length:g} {result.units}"
    return Drawing((width, height), 1.0, tuple(areas), tuple(areas), (), tuple(lines), (), (ruler, text))


def take_paper() -> Any:
    """A figure and its axes for sections, one after the other: to make new ones takes longer than to draw."""
    figure, axes = _make_figure(WIDTH, HEIGHT)
    axes.set_position((0, 0, 1, 1))
    axes.set_axis_off()  # a ruler instead: ticks take longer than all the rest
    axes.set_aspect("equal")
    return figure, axes


def draw_histogram(result: Result) -> str:
    """How far the intact points are from the skin, with the tolerance and the noise of the scan."""
    figure, axes = _make_figure(WIDTH, 3.0)
    distance = result.deviation.distance[result.deviation.label == INTACT]
    reach = 1.25 * result.tolerance
    count, edges = np.histogram(distance, bins=np.linspace(-reach, reach, 81))
    axes.stairs(count / max(count.sum(), 1) * 100, edges, fill=True, color="#4f86c6", alpha=0.75, gid="counts")
    for sign in (-1, 1):
        axes.axvline(sign * result.tolerance, color="#d1495b", lw=1.3, ls="--")
    noise = result.scan.noise
    if 0 < noise < reach:
        axes.axvspan(-noise, noise, color=SOFT, alpha=0.25, lw=0)
    axes.set(xlim=(-reach, reach))
    axes.set_xlabel(f"signed distance to the nominal surface, {result.units}", fontsize=8.5)
    axes.set_ylabel("intact points, %", fontsize=8.5)
    return _to_svg(figure, "histogram")


def _make_figure(width: float, height: float) -> tuple[Any, Any]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height))
    figure.patch.set_alpha(0)
    axes = figure.add_axes((LEFT / width, BOTTOM / height, 1 - (LEFT + 0.1) / width, 1 - (BOTTOM + 0.08) / height))
    axes.set_facecolor("none")
    axes.tick_params(colors=SOFT, labelcolor=INK, labelsize=8)
    axes.xaxis.label.set_color(INK)
    axes.yaxis.label.set_color(INK)
    for spine in axes.spines.values():
        spine.set_color(SOFT)
        spine.set_linewidth(0.6)
    return figure, axes


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


def _fill(
    axes: Any, loops: list[Floats], fill: str, line: str, width: float, label: str, alpha: float, dashed: bool = False
) -> None:
    from matplotlib.colors import to_rgba
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    if not loops:
        return
    path = Path.make_compound_path(*(Path(loop, closed=True) for loop in loops))
    face = "none" if fill == "none" else (fill if alpha == 1 else to_rgba(fill, alpha))
    patch = PathPatch(path, fc=face, ec=line, lw=width, ls="--" if dashed else "-")
    patch.set_gid(label.replace(" ", "-"))
    axes.add_artist(patch)


def _draw_surface(axes: Any, surface: Mesh, plane: Plane, colour: str) -> None:
    """Draws where an open mesh crosses the plane."""
    if not len(surface.faces):
        return
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
    line = np.concatenate([np.stack(ends, axis=1), gap], axis=1).reshape(-1, 2)
    _add_line(axes, line, color=colour, lw=1.8, gid="inner-damage-surface")


def _draw_points(axes: Any, result: Result, plane: Plane, low: Floats, high: Floats) -> float:
    """Draws the scan points near the plane; gives how near they are."""
    slab = max(float(result.scan.spacing), 0.5 * result.tolerance)
    off = np.abs(result.aligned.points @ plane.across - plane.origin @ plane.across)
    near = np.flatnonzero(off <= slab)
    flat, _ = plane.project(result.aligned.points[near])
    inside = ((flat > low) & (flat < high)).all(axis=1)
    flat, off = flat[inside], off[near[inside]]
    if len(off) > MOST_POINTS:
        slab = float(np.partition(off, MOST_POINTS - 1)[MOST_POINTS - 1])
    shown = flat[off <= slab]
    _add_line(axes, shown, marker="o", ms=1.7, mew=0, color=INK, ls="none", gid="scan-points")
    return slab


def _draw_ruler(axes: Any, low: Floats, high: Floats, unit: str) -> None:
    """A ruler of a round length at the bottom left, with a mark at each tenth of it."""
    width, height = high - low
    length = style.round_nice(0.3 * width)
    x, y, tick = low[0] + 0.03 * width, low[1] + 0.04 * height, 0.012 * height
    line = [(x, y + 2 * tick), (x, y), (x + length, y), (x + length, y + 2 * tick)]
    for k in range(1, 10):
        line += [(np.nan, np.nan), (x + k * length / 10, y), (x + k * length / 10, y + (1.6 if k == 5 else 1) * tick)]
    _add_line(axes, np.array(line), color=INK, lw=1.2, gid="ruler")
    axes.text(x + length, y + 3 * tick, f"{length:g} {unit}", ha="center", va="bottom", color=INK, fontsize=9)
    axes.text(x, y + 3 * tick, "0", ha="center", va="bottom", color=INK, fontsize=9)


def _add_line(axes: Any, points: Floats, **look: Any) -> None:
    """As matplotlib's ``plot``, for points (N,2), but without looking for new limits."""
    from matplotlib.lines import Line2D

    axes.add_artist(Line2D(*points.T, **look))


def _to_svg(figure: Any, name: str) -> str:
    """The figure as an SVG element, its ids beginning with ``name``, its colours those of the page."""
    import matplotlib as mpl

    stream = io.StringIO()
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": name, "font.family": "sans-serif"}):
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    text = stream.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.S)
    text = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", text)
    text = re.sub(r'<svg [^>]*viewBox="([^"]*)"[^>]*>', r'<svg viewBox="\1" aria-hidden="true">', text, count=1)
    text = re.sub(r"font: ([0-9.]+px)[^;\"]*", r"font: \1 system-ui, sans-serif", text)
    for colour, variable in VARIABLES.items():
        text = text.replace(colour, variable)
    return text
