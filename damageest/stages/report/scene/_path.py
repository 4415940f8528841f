"""A site's deposition path in the 3D view: passes by layer, nozzle and beam, what no pass reaches."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.nozzle import place_tool
from damageest.io import colours
from damageest.result import Site
from damageest.stages.report import _style as style
from damageest.stages.report.scene.scene_stage import Stage


def add_path(stage: Stage, site: Site) -> None:
    """Adds the passes of a site, each layer of the deposit an object, the nozzle and its beam at the end of each layer
    and where it is tightest, and what no pass reaches."""
    import k3d

    path = site.path
    if path is None:
        return
    if path.missing is not None:
        stage.add_mesh(path.missing, "unreached", colours.UNREACHED, site.id)
    if not path.on.any():
        return
    ends = np.flatnonzero(path.on)
    kinds, number = np.unique(np.stack([path.part[ends], path.layer[ends]]), axis=1, return_inverse=True)
    count = kinds.shape[1]
    minutes = np.cumsum(path.moves / path.feed + path.waits / 60)
    for k in range(count):
        own = ends[number.ravel() == k]
        points = np.concatenate([path.points[own - 1], path.points[own]])
        pairs = np.stack([np.arange(len(own)), np.arange(len(own)) + len(own)], axis=1).astype(np.uint32)
        colour = colours.pick_colour(colours.VIRIDIS, k / max(count - 1, 1))
        lines = k3d.lines(
            stage.place(points), pairs, indices_type="segment", shader="simple", color=style.to_number(colour),
            width=0.02, name="path",
        )  # fmt: skip
        stage.add(lines, "path", site.id, k + 1)
        stage.objects[-1]["minutes"] = float(f"{minutes[own[-1]]:.3g}")
        _add_tool(stage, site, path.points[own[-1]], path.axes[own[-1]], k + 1)
    if path.tightest is not None:
        _add_tool(stage, site, *path.tightest)


def _add_tool(stage: Stage, site: Site, point: Floats, axis: Floats, height: int = 0) -> None:
    """Adds nozzle and beam at a point (3,) with a tool axis (3,); with a ``height``, for that layer alone."""
    assert site.path is not None
    nozzle, beam = place_tool(site.path, point, axis)
    layer = "tool" if height else "nozzle"
    stage.add_mesh(nozzle, layer, colours.NOZZLE, site.id, 0.5, height)
    stage.add_mesh(beam, layer, colours.BEAM, site.id, 0.7, height)
