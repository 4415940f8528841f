"""Stock to mill off again: the deposit stands proud of the nominal surface where it will be milled, and only there."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Deposit, Floats, Part, Solid
from damageest.errors import StageError
from damageest.stages.allowance import Allowance
from damageest.stages.allowance._selectors import KeepOut, StockPlan, StockTarget

MAX_DUST = 1e-6
"""Share of the stock's volume."""
SHEET_GAP = 1e-3
"""Of the tolerance: by how much sheets that touch are moved apart."""


class Milling(Allowance):
    """Stock beyond the nominal surface, to be milled off after deposition; skin by skin, with regions kept free, and a
    cut-back into sound metal. All lengths in the job's unit, all places in part coordinates."""

    use: Literal["milling"] = "milling"
    outer: float = Field(
        0.0, ge=0, allow_inf_nan=False,
        description="stock beyond the nominal surface, along its normal, in the job's unit, where no target matches",
    )  # fmt: skip
    targets: tuple[StockTarget, ...] = Field(
        (),
        description="skin with an `outer` of its own, the first match wins: {outer: 1.0, ...} with one or more of "
        "box: [[x, y, z], [x, y, z]]; half_space: {point, normal}; facing: {direction, angle} (degrees); "
        "faces: [numbers or names of CAD faces]; kind: plane, cylinder or other (of the CAD face). Lengths in the "
        "job's unit, places in part coordinates",
    )
    keep_out: tuple[KeepOut, ...] = Field(
        (),
        description="what the deposit must not enter: solids {box: ...}, {cylinder: {from, to, radius}}, {mesh: path}; "
        "or skin as in `targets`, over which there is no stock then. Lengths in the job's unit",
    )
    overlap: float = Field(
        0.0, ge=0, allow_inf_nan=False,
        description="how far the stock runs over the intact surface round the rim, in the job's unit; 0: not at all",
    )  # fmt: skip
    inner: float = Field(
        0.0, ge=0, allow_inf_nan=False,
        description="cut-back: sound metal within this of the inner damage surface goes to the cavity, in the job's "
        "unit; 0: none",
    )  # fmt: skip
    crowded: Literal["refuse", "clip"] = Field(
        "refuse",
        description="where stock would run into an opposite wall, close a bore or fill a gap: refuse the site, or "
        "clip (the stock ends at the wall, a gap fills up; a warning says where)",
    )

    def run(self, damage: Solid, part: Part, tolerance: float, others: Solid | None) -> Solid | None:
        """Raises StageError where there is no room for the stock, a region to keep free is already damaged, or a
        guarantee is not kept."""
        from manifold3d import Manifold

        from damageest.geometry.solids import subtract_lost, to_manifold
        from damageest.stages.allowance._booleans import join, keep_touching, separate_sheets, simplify_exactly
        from damageest.stages.allowance._cut_back import cut_back
        from damageest.stages.allowance._keep_out import build_keep_out
        from damageest.stages.allowance._limits import find_stock_conflict
        from damageest.stages.allowance._overlap import grow_over_rim
        from damageest.stages.allowance._skin import take_skin
        from damageest.stages.allowance._stock import build_stock
        from damageest.stages.allowance._verify import DepositGeometry, check_deposit

        origin: Floats = part.bounds.mean(axis=0)
        plan = StockPlan(self.outer, self.targets, self.keep_out)
        cavity = cut_back(damage, part, others, self.inner, tolerance) if self.inner else damage
        filled, whole = to_manifold(cavity, origin), to_manifold(part, origin)
        left = subtract_lost(whole, filled)
        skin = take_skin(cavity, part, plan, origin)
        reach = plan.max_height + tolerance
        barred = build_keep_out(self.keep_out, skin, filled, part, plan, reach, origin, tolerance)
        band = grow_over_rim(skin, part, plan, self.overlap, tolerance, origin)
        skins = [skin] if band is None else [skin, band]
        crowds = [crowd for each in skins if (crowd := find_stock_conflict(each, part, tolerance, origin)) is not None]
        if crowds and self.crowded == "refuse":
            raise StageError(str(crowds[0]), "a smaller outer there by targets, keep_out, or crowded: clip")
        proud = sum((build_stock(each, tolerance / 2, roomy=not crowds) for each in skins), Manifold())
        proud = simplify_exactly(proud, part.diagonal)
        for body in (left, barred):
            within = proud ^ body
            # crumbs of rounding, cut off, would leave lines where the stock touches what it stands on and no more
            if within.volume() > MAX_DUST * proud.volume():
                proud = subtract_lost(proud, within)
        deposit = simplify_exactly(join(filled, keep_touching(proud, filled, tolerance)), part.diagonal)
        thickness = check_deposit(
            DepositGeometry(deposit, filled, left, barred, skin, band, origin), part, tolerance, crowds
        )
        body = separate_sheets(deposit, origin, SHEET_GAP * tolerance)
        if body is None:
            raise StageError("the deposit came out empty", "a slightly different outer")
        notes = [f"{crowd}; clipped there" for crowd in crowds[:1]]
        if thickness is None:
            notes.append("no stock is asked for on the skin of this damage: the deposit ends at the nominal surface")
        return Deposit(
            body.vertices,
            body.faces,
            cavity=None if cavity is damage else cavity,
            stock_volume=max(body.volume - cavity.volume, 0.0),
            cut_back_volume=max(cavity.volume - damage.volume, 0.0),
            thickness=thickness,
            touched=() if part.faces_brep is None else _find_touched(part, skins),
            notes=tuple(notes),
        )


def _find_touched(part: Part, skins: list[Any]) -> tuple[int, ...]:
    """The CAD faces that stock stands on."""
    assert part.faces_brep is not None
    parents = np.concatenate([skin.parent[skin.height > 0] for skin in skins])
    return tuple(np.unique(part.faces_brep[parents]).tolist())
