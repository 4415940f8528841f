"""The 3D view: what it shows, as a snapshot for k3d's script."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from typing import Any

import numpy as np

from damageest.artefacts import DAMAGE, INTACT, Mesh
from damageest.io import colours
from damageest.io.section_files import round_nice
from damageest.result import Result, Site
from damageest.stages.report import _style as style
from damageest.stages.report._thin import find_sharp_edges, thin_mesh, thin_points
from damageest.stages.report._values import choose_least_ends
from damageest.stages.report._words import N_
from damageest.stages.report.scene._least_depth import map_least_depth
from damageest.stages.report.scene._path import add_path
from damageest.stages.report.scene.scene_stage import Stage

LAYERS = {
    "part": (N_("Part"), True),
    "scan": (N_("Scan, by signed deviation"), False),
    "points": (N_("Damage points"), False),
    "damage": (N_("Damage volumes"), True),
    "surface": (N_("Inner damage surfaces"), False),
    "deposit": (N_("Deposits"), False),
    "path": (N_("Deposition passes, by layer"), True),
    "tool": (N_("Nozzle and beam at the end of the layer"), False),
    "nozzle": (N_("Nozzle and beam at the tightest place"), False),
    "unreached": (N_("Unreached deposit"), True),
    "surplus": (N_("Surplus"), True),
    "unseen": (N_("Unseen skin"), True),
    "least": (N_("Least visible depth of a loss"), False),
    "form": (N_("Form, exaggerated"), False),
}
"""Name in the page's script, to name on the page and whether it is shown at first."""


EXAGGERATED = 50
"""How many times the form of an adapted part is exaggerated at most."""
FORM_TRIANGLES = 20_000
"""Triangles at most of the part that is drawn with its form exaggerated."""
VISIBLE = 0.04
"""How much of the part's diagonal it moves at first, about."""


@dataclass
class Scene:
    """``snapshot``: k3d's binary snapshot in base64. ``objects``: for each object of it its number, layer, site (0:
    none) and, for passes and the tool, the number of the deposit's layer that they belong to, counted over its parts
    (else 0); ``alone``: it is shown with no other layer; ``minutes`` of passes: when the layer is done.
    ``views``: for each site, by number, centre, radius and viewing direction. ``origin`` (3,): what was subtracted from
    all coordinates. ``size`` (3,): half of the part's extents. ``limit``: the deviation at the ends of the colour bar.
    ``shown``, ``points``: how many scan points are shown, of how many. ``exaggerate``: by how much the form of an
    adapted part is exaggerated at first; 0 where the part is as designed."""

    snapshot: str
    objects: list[dict[str, Any]]
    origin: list[float]
    size: list[float]
    limit: float
    shown: int
    points: int
    exaggerate: int = 0


def build_scene(result: Result, most_points: int, most_triangles: int) -> Scene:
    """The 3D view of a result with at most ``most_points`` scan points and about ``most_triangles`` triangles."""
    import k3d

    part = result.part
    step = 2.0 ** np.floor(np.log2(part.diagonal / 2**17))
    stage = Stage(np.round(part.bounds.mean(axis=0) / step) * step, step)
    share = _share_triangles(result, most_triangles)
    shown = thin_mesh(part, share)
    stage.add_mesh(shown, "part", colours.PART, opacity=0.18)
    _add_edges(stage, result)
    limit = choose_limit(result)
    count = _add_scan(stage, result, most_points, limit)
    for site in result.sites:
        _add_site(stage, result, site, share, most_points // 4)
    for item in result.surplus:
        if item.solid is not None:
            stage.add_mesh(thin_mesh(item.solid, share), "surplus", colours.SURPLUS)
        else:
            places = result.aligned.points[item.points]
            places = places[thin_points(places, most_points // 8)]
            stage.add_points(places, "surplus", 0, part.diagonal / 300, color=style.to_number(colours.SURPLUS))
    _add_unseen(stage, result, share)
    _add_least_depth(stage, result, most_points // 4)
    exaggerate = _add_form(stage, result, min(share, FORM_TRIANGLES))
    plot = k3d.plot(
        grid_visible=False, menu_visibility=False, camera_auto_fit=False, camera_mode="trackball", axes_helper=1.0,
        mode="callback", colorbar_object_id=0, camera_fov=35.0, lighting=1.6, fps=0, antialias=2,
    )  # fmt: skip
    for item in stage.made:
        plot += item
    snapshot = base64.b64encode(plot.get_binary_snapshot(compression_level=4)).decode()
    half = (np.ptp(part.bounds, axis=0) / 2).tolist()
    return Scene(
        snapshot, stage.objects, stage.origin.tolist(), half, limit, count, len(result.scan.points), exaggerate
    )


def choose_limit(result: Result) -> float:
    """The deviation at the ends of the colour bar: twice the tolerance at least, and where most damage points lie."""
    deviation = result.deviation
    known = np.isin(deviation.label, (INTACT, DAMAGE))
    far = float(np.quantile(np.abs(deviation.distance[known]), 0.995)) if known.any() else 0.0
    return round_nice(max(2 * result.tolerance, far) * 1.25)


def _share_triangles(result: Result, most: int) -> int:
    """How many triangles each mesh may have: those that have fewer leave the rest to the others."""
    meshes: list[Mesh] = [result.part, *(item.solid for item in result.surplus if item.solid)]
    for site in result.sites:
        meshes += [site.damage, site.surface, *([site.deposit] if site.deposit else [])]
    counts = np.sort([len(mesh.faces) for mesh in meshes])
    left = most
    for k, count in enumerate(counts):
        share = left // (len(counts) - k)
        if count > share:
            return max(share, 500)
        left -= count
    return most


def _add_edges(stage: Stage, result: Result) -> None:
    import k3d

    edges = find_sharp_edges(result.part)
    if not 0 < len(edges) <= 60_000:
        return
    used, number = np.unique(edges, return_inverse=True)
    lines = k3d.lines(
        stage.place(result.part.vertices[used]), number.reshape(-1, 2).astype(np.uint32), indices_type="segment",
        shader="simple", color=style.to_number("#6b767d"), width=0.01, name="edges",
    )  # fmt: skip
    stage.add(lines, "part")


def _add_scan(stage: Stage, result: Result, most: int, limit: float) -> int:
    """Adds the scan, coloured; gives how many points it has there."""
    import k3d

    surroundings = np.zeros(len(result.scan.points), bool)
    for item in result.surplus:
        surroundings[item.points] |= item.kind == "surroundings"
    own = np.flatnonzero(~surroundings)
    chosen = own[thin_points(result.aligned.points[own], most)]
    values = np.clip(result.deviation.distance[chosen], -limit, limit)
    stage.add_points(
        result.aligned.points[chosen], "scan", 0, _choose_point_size(result, len(chosen)),
        attribute=(np.round(values / limit * 127) / 127 * limit).astype(np.float32), color_range=[-limit, limit],
        color_map=getattr(k3d.matplotlib_color_maps, colours.DEVIATION.capitalize()),
    )  # fmt: skip
    return len(chosen)


def _choose_point_size(result: Result, count: int) -> float:
    """Points just large enough to cover the part."""
    return float(1.6 * np.sqrt(result.part.area / max(count, 1)))


def _add_site(stage: Stage, result: Result, site: Site, share: int, most_points: int) -> None:
    colour = colours.colour_site(site.id)
    points = result.aligned.points[site.points]
    places = points[thin_points(points, max(most_points // len(result.sites), 500))]
    size = float(0.7 * np.sqrt(max(site.surface.area, 1e-12 * result.part.area) / max(len(places), 1)))
    stage.add_points(places, "points", site.id, size, color=style.to_number(colour))
    stage.add_mesh(thin_mesh(site.damage, share), "damage", colour, site.id)
    stage.made[-1].click_callback = _tell_nobody  # that there is one makes the script report clicks
    stage.add_mesh(thin_mesh(site.surface, share), "surface", colour, site.id)
    if site.deposit is not None:
        stage.add_mesh(thin_mesh(site.deposit, share), "deposit", colours.DEPOSIT, site.id, opacity=0.75)
    add_path(stage, site)


def _add_form(stage: Stage, result: Result, share: int) -> int:
    """Adds the part as designed, with its displacement at each end of the page's slider, coloured by its length; gives
    how many times the displacement is exaggerated at first, 0 where there is none."""
    import k3d
    from scipy.spatial import cKDTree

    adapted = result.adapted
    if adapted is None or not adapted.amount:
        return 0
    designed = adapted.part.vertices - adapted.displacement
    shown = thin_mesh(Mesh(designed, adapted.part.faces), share)
    moved = adapted.displacement[cKDTree(designed).query(shown.vertices)[1]]
    length = np.linalg.norm(moved, axis=1)
    most = round_nice(float(length.max()))
    ends = {"0": stage.place(shown.vertices), f"{EXAGGERATED}": stage.place(shown.vertices + EXAGGERATED * moved)}
    item = k3d.mesh(
        ends, shown.faces.astype(np.uint32), attribute=(np.round(length / most * 127) / 127 * most).astype(np.float32),
        color_range=[0.0, most], color_map=k3d.matplotlib_color_maps.Viridis, side="double", flat_shading=True,
        name="form",
    )  # fmt: skip
    stage.add(item, "form")
    return int(np.clip(VISIBLE * result.part.diagonal / adapted.amount, 1, EXAGGERATED))


def _add_unseen(stage: Stage, result: Result, share: int) -> None:
    coverage = result.coverage
    if coverage is None or not (coverage.region >= 0).any():
        return
    faces = coverage.skin.faces[coverage.region >= 0]
    used, number = np.unique(faces, return_inverse=True)
    skin = Mesh(coverage.skin.vertices[used], number.reshape(-1, 3))
    stage.add_mesh(thin_mesh(skin, share), "unseen", colours.UNSEEN, opacity=0.45)


def _add_least_depth(stage: Stage, result: Result, most: int) -> None:
    """Adds points of the skin, coloured by the least depth of a loss that the scan can show there."""
    import k3d

    if result.sensor is None:
        return
    own = np.flatnonzero(result.deviation.label == INTACT)
    chosen = own[thin_points(result.aligned.points[own], most)]
    depth = map_least_depth(result.aligned, result.deviation, result.sensor, result.tolerance, chosen)
    ends = choose_least_ends(result.sensor, result.tolerance)
    stage.add_points(
        result.aligned.points[chosen], "least", 0, _choose_point_size(result, len(chosen)),
        attribute=np.clip(depth, ends[0], ends[1]).astype(np.float32), color_range=ends,
        color_map=k3d.matplotlib_color_maps.Viridis,
    )  # fmt: skip


def _tell_nobody(_: Any) -> None:
    """Clicks are handled by the page."""
