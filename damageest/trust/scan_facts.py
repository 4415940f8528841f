"""What the whole scan says about errors that no site is to be blamed on, as skin that deviates."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from damageest.artefacts import ADDED, Pose
from damageest.findings import Surplus
from damageest.geometry.scan_field import ScanField
from damageest.geometry.voxels import measure_area
from damageest.trust.doubt import ScanFacts
from damageest.trust.skin.coverage import SkinView
from damageest.trust.skin.skin_cells import AVERAGED
from damageest.trust.views.two_sheets import Sheets
from damageest.trust.views.view_overlap import compare_views

FEWEST_OUTSIDE = 3
"""Points in a cube of skin that lies outside; fewer may be noise."""
FEWEST_CELLS = 30
"""Cells of the skin below which nothing is said of their spread."""
LAYER = 5.0
"""Height in tolerances up to which points outside count as skin that lies outside; higher ones are added metal."""


def gather_scan_facts(
    field: ScanField, skin: SkinView, surplus: Iterable[Surplus], sheets: Sheets, pose: Pose, is_fitted: bool, unit: str
) -> ScanFacts:
    """Measures how far skin deviates that is not damaged.

    ``surplus``: higher one is left out, since it is metal. ``is_fitted``: whether the scan decides the ``pose``.
    """
    aligned, tolerance = field.aligned, field.tolerance
    layer = (field.label == ADDED) & (field.distance < LAYER * tolerance)
    for one in surplus:
        if one.height > LAYER * tolerance or one.kind == "surroundings":
            layer[one.points] = False
    area, height = 0.0, 0.0
    if layer.any():
        area = measure_area(aligned.points[layer], skin.cells.edge, FEWEST_OUTSIDE)
        height = float(np.quantile(field.distance[layer], 0.9))
    return ScanFacts(
        tolerance=tolerance,
        spacing=aligned.spacing,
        unit=unit,
        noise=aligned.noise,
        seen_area=float(skin.cells.areas[skin.seen].sum()),
        is_fitted=is_fitted,
        systematic=_measure_systematic(skin, aligned.noise),
        outward_area=area,
        outward_height=height,
        between_views=compare_views(field, skin.cells.edge),
        sheets_share=sheets.share,
        sheets_apart=sheets.apart,
        pose=pose.doubts,
    )


def _measure_systematic(skin: SkinView, noise: float) -> float:
    """Standard deviation of the mean distances of intact cells that noise does not explain.

    The smaller of what the cells show inside and outside: wear below the tolerance lies inside alone, and is no error
    of the scan.
    """
    distance = skin.distance[skin.perhaps_seen & np.isfinite(skin.distance)]
    if len(distance) < FEWEST_CELLS:
        return 0.0
    # half the width of the middle 90 %, in standard deviations of a normal distribution
    low, high = np.quantile(distance, [0.05, 0.95])
    spread = max(float(min(-low, high)), 0.0) / 1.645
    return float(np.sqrt(max(spread**2 - noise**2 / AVERAGED, 0.0)))
