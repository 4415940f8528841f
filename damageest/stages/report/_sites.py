"""Contents of the report for each site."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh, Part
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.rays import RayCaster
from damageest.geometry.remaining import subtract_from_part
from damageest.geometry.solids import concatenate_meshes, to_manifold
from damageest.geometry.views import OVERVIEWS, View, choose_view
from damageest.io import colours
from damageest.result import Result, Site
from damageest.stages.report import _style as style
from damageest.stages.report._drawing import draw
from damageest.stages.report._section import choose_plane, draw_section
from damageest.stages.report._thin import thin_mesh
from damageest.stages.report._values import list_path, show_interval, show_site_interval
from damageest.stages.report._words import Words

PICTURE, SMALLER, THUMBNAIL = (320, 240), (240, 180), (104, 78)
THUMBNAIL_TRIANGLES = 4000
"""About as many as a thumbnail has pixels that show the mesh."""
FEW = 6
"""Up to so many sites, pictures are drawn in full size with smooth edges."""
MOST_DRAWN = 12
"""Sites with pictures and a section, so that a report takes few seconds; of more, those of the largest volume."""


@dataclass
class Shown:
    """A site on the page: its values as text, its pictures as PNG, its section as SVG. Pictures are empty for a
    site beyond `MOST_DRAWN`."""

    id: int
    colour: str
    level: str
    accepted: bool
    reasons: list[str]
    volume: str
    interval: str
    depth: str
    depth_interval: str
    area: str
    points: str
    method: str
    faces: str
    deposit: list[tuple[str, str]]
    path: list[tuple[str, str]]
    budget: Mapping[str, Any] | None
    depth_budget: Mapping[str, Any] | None
    files: list[tuple[str, str, bytes]] = field(default_factory=list)
    picture: bytes = b""
    section: str = ""
    plane: str = ""
    view: dict[str, Any] = field(default_factory=dict)


def describe_sites(result: Result, content: Mapping[str, Any], remains: Remains, words: Words) -> list[Shown]:
    """Values, pictures and sections of all sites. ``content``: that of result.json."""
    if not result.sites:
        return []
    part = to_manifold(result.part, result.part.bounds.mean(axis=0))
    drawn = {s.id for s in sorted(result.sites, key=lambda s: -s.damage.volume)[:MOST_DRAWN]}
    shown = []
    for site, told in zip(result.sites, content["sites"], strict=True):
        one = _describe(result, site, told, words)
        mesh, rays = remains.without(site)
        view = choose_view(rays, site.surface, site.damage.bounds, result.part.diagonal)
        one.view = _to_plain(view)
        if site.id in drawn:
            _draw_site(result, site, told, one, view, (rays, mesh), part, words)
        shown.append(one)
    return shown


class Remains:
    """What is left of the part, for rays: without all accepted sites, or without a single one that is not accepted."""

    def __init__(self, result: Result) -> None:
        self._result = result
        self._shared: RayCaster | None = None

    def without_accepted(self, undamaged: Mesh) -> tuple[Mesh, RayCaster]:
        """The undamaged volume and its rays, which are prepared once: of a million triangles that takes seconds."""
        self._shared = self._shared or RayCaster(undamaged)
        return undamaged, self._shared

    def without(self, site: Site) -> tuple[Mesh, RayCaster]:
        part = self._result.part
        if site.accepted and self._result.undamaged is not None:
            return self.without_accepted(self._result.undamaged)
        left = subtract_from_part(part, [site.damage]) or part
        return left, RayCaster(left)


def choose_overview(result: Result, remains: Remains) -> Floats:
    """The direction (3,) from where most of the damage is seen, of those that all of the part is looked at from."""
    if not result.sites or result.undamaged is None:
        return np.asarray(OVERVIEWS[0])
    vertices, faces, _ = concatenate_meshes([site.surface for site in result.sites])
    left, rays = remains.without_accepted(result.undamaged)
    return choose_view(rays, Mesh(vertices, faces), left.bounds, left.diagonal, OVERVIEWS).direction


def _describe(result: Result, site: Site, told: Mapping[str, Any], words: Words) -> Shown:
    unit = result.units
    deposit = told["deposit"]
    rows = []
    if deposit is not None and site.deposit is not None:
        rows = [(words.tell("deposit"), f"{style.format_number(deposit['volume'])} {unit}³")]
        rows += [(words.tell("stock in it"), f"{style.format_number(deposit['stock_volume'])} {unit}³")]
        if deposit["cut_back_volume"]:
            rows += [(words.tell("cut back"), f"{style.format_number(deposit['cut_back_volume'])} {unit}³")]
    elif site.refused:
        rows = [(words.tell("deposit"), words.tell("none: the stage allowance refused this site"))]
    return Shown(
        id=site.id,
        colour=colours.colour_site(site.id),
        level=site.verdict.level,
        accepted=site.accepted,
        reasons=list(map(str, (*site.verdict.reasons, *site.warnings))),
        volume=f"{style.format_number(site.damage.volume)} {unit}³",
        interval=show_site_interval(site, unit, words),
        depth=f"{style.format_number(site.max_depth, 3)} {unit}",
        depth_interval=show_interval(site.depth_95, unit, words),
        area=f"{style.format_number(site.surface.area)} {unit}²",
        points=style.format_number(len(site.points)),
        method=site.method,
        faces=name_faces(result.part, site.damage, result.tolerance),
        deposit=rows,
        path=list_path(site, unit, words),
        budget=(told.get("uncertainty") or {}).get("budget"),
        depth_budget=(told.get("uncertainty") or {}).get("depth_budget"),
    )


def name_faces(part: Part, damage: Mesh, tolerance: float) -> str:
    """The CAD faces that a damage volume takes skin from, in words; empty where the part has none."""
    if part.faces_brep is None:
        return ""
    near = closest_on_mesh(damage.triangles.mean(axis=1), part)
    aligned = np.abs(np.einsum("ij,ij->i", damage.face_normals, part.face_normals[near.face])) > 0.99
    area = damage.face_areas
    taken = (near.distance < 0.1 * tolerance) & aligned
    number = part.faces_brep[near.face[taken]]
    total = np.bincount(number, weights=area[taken])
    words = []
    for face in np.flatnonzero(total > 1e-3 * total.sum()):
        name = part.face_names[face] if face < len(part.face_names) else ""
        kind = part.face_kinds[face] if face < len(part.face_kinds) else ""
        words.append(f"{face}" + (f" “{name}”" if name else "") + (f" ({kind})" if kind else ""))
    return ", ".join(words)


def _draw_site(
    result: Result,
    site: Site,
    told: Mapping[str, Any],
    one: Shown,
    view: View,
    left: tuple[RayCaster, Mesh],
    part: Any,
    words: Words,
) -> None:
    rays, mesh = left
    smooth, near = len(result.sites) <= FEW, view._replace(radius=1.05 * view.radius)
    layers = [(rays, mesh, "#c3ccd2")]
    # of many sites the picture shows the thinned surface, as the thumbnail does: rays are prepared once for both
    surface = site.surface if smooth else thin_mesh(site.surface, THUMBNAIL_TRIANGLES)
    prepared = {"surface": (RayCaster(surface), surface)} if len(surface.faces) else {}
    layers += [(*both, one.colour) for both in prepared.values()]
    one.picture = draw(view._replace(radius=1.7 * view.radius), layers, PICTURE if smooth else SMALLER, smooth)
    plane = choose_plane(result, site)
    one.section, slab = draw_section(result, site, plane, part)
    at = ", ".join(style.format_number(x) for x in plane.origin)
    normal = ", ".join(style.format_number(x, 3) for x in np.round(plane.across, 4) + 0.0)
    one.plane = words.tell(
        "through ({at}), normal ({normal}); scan points within {distance}",
        at=at, normal=normal, distance=f"{style.format_number(slab, 2)} {result.units}",
    )  # fmt: skip
    deposit = site.deposit or site.damage
    shapes = [("damage", site.damage, one.colour), ("surface", site.surface, one.colour)]
    for kind, shape, colour in [*shapes, ("deposit", deposit, colours.DEPOSIT)]:
        if len(shape.faces) and told["files"][kind]:
            if kind not in prepared:
                small = thin_mesh(shape, THUMBNAIL_TRIANGLES)
                prepared[kind] = RayCaster(small), small
            image = draw(near, [(*prepared[kind], colour)], THUMBNAIL, smooth)
            one.files.append((kind, told["files"][kind], image))


def _to_plain(view: View) -> dict[str, Any]:
    return {
        "centre": view.centre.tolist(),
        "radius": view.radius,
        "direction": view.direction.tolist(),
        "up": view.up.tolist(),
    }
