"""Stock to mill off: the deposit is higher than the nominal surface where it will be milled, and only there."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Deposit, Floats, Part, Solid
from damageest.errors import StageError
from damageest.geometry.near_faces import name_nearest_skin
from damageest.geometry.selectors import Selector
from damageest.stages.allowance import Allowance
from damageest.stages.allowance._booleans import drop_crumbs
from damageest.stages.allowance._limits import StockConflict
from damageest.stages.allowance._prepare import Prepare, open_cavity
from damageest.stages.allowance._selectors import KeepOut, StockPlan, StockTarget
from damageest.stages.allowance._skin import ON_PART

MAX_DUST = 1e-6
"""Share of the stock's volume up to which an overlap is left: it is a rounding error."""
SLIVERS = 1e-6
"""Share of the damage's skin on a CAD face that may have another height of stock: slivers of cuts."""

CRUMB, SPECK = 1e-7, 1e-2
"""Share of the damage volume, and of a cube of the tolerance, up to which a piece of the cavity, of the metal milled
off or of the deposit is a rounding error."""


class Milling(Allowance):
    """Adds stock on the nominal surface, to mill off after deposition, and cuts back into intact metal.

    Stock may have another height on chosen skin, and regions may be kept free. All lengths are in the job's unit, all
    places in part coordinates.
    """

    renamed: ClassVar[Mapping[str, str]] = {"crowded": "interference"}
    use: Literal["milling"] = "milling"
    outer: float = Field(
        0.0, ge=0, allow_inf_nan=False,
        description="height of the stock above the nominal surface, along its normal, in the job's unit; where no "
        "target matches",
    )  # fmt: skip
    targets: tuple[StockTarget, ...] = Field(
        (),
        description="skin with its own `outer`; the first target that matches is used: {outer: 1.0, ...} with one or "
        "more of box: [[x, y, z], [x, y, z]]; half_space: {point, normal}; facing: {direction, angle} (degrees); "
        "faces: [numbers or names of CAD faces]; kind: plane, cylinder or other (of the CAD face). Lengths in the "
        "job's unit, places in part coordinates",
    )
    keep_out: tuple[KeepOut, ...] = Field(
        (),
        description="regions that the deposit must not enter: solids {box: ...}, {cylinder: {from, to, radius}}, "
        "{mesh: path}; or skin, as in `targets`, which then gets no stock. Lengths in the job's unit",
    )
    overlap: float = Field(
        0.0, ge=0, allow_inf_nan=False,
        description="width of the intact skin around the rim that the stock covers, in the job's unit; 0: none",
    )  # fmt: skip
    inner: float = Field(
        0.0, ge=0, allow_inf_nan=False,
        description="cut-back: intact metal within this distance of the inner damage surface is added to the cavity, "
        "in the job's unit; 0: none",
    )  # fmt: skip
    prepare: Prepare | None = Field(
        None,
        description="{min_radius, wall_angle, undercut: remove, depth}: opens the cavity for cutter and beam before "
        "deposition: walls lean outward by wall_angle (degrees), undercuts go, places narrower than the radius are "
        "widened, depth is added below; default: not opened. The damage volume stays",
    )
    interference: Literal["refuse", "clip"] = Field(
        "refuse",
        description="stock that would run into an opposite wall, close a bore or fill a gap: refuse the site, or "
        "clip (the stock ends at the wall or fills the gap; a warning names the place)",
    )

    def find_idle_region(self, selector: Selector, part: Part) -> str:
        """Why a solid to keep free keeps nothing free: it is beyond the reach of stock on this part."""
        bounds = selector.bound_solid() if isinstance(selector, KeepOut) else None
        if bounds is None:
            return ""
        reach = 2 * StockPlan(self.outer, self.targets, self.keep_out).max_height + ON_PART * part.diagonal
        gap = np.maximum(bounds[0] - part.bounds[1], part.bounds[0] - bounds[1])
        if (gap <= reach).all():
            return ""
        x, y, z = part.bounds.T
        return (
            f"this solid is {float(np.linalg.norm(np.maximum(gap, 0))):.4g} from the box of the part, "
            f"x {x[0]:.4g} to {x[1]:.4g}, y {y[0]:.4g} to {y[1]:.4g}, z {z[0]:.4g} to {z[1]:.4g}, where no deposit "
            f"reaches: {name_nearest_skin(Selector(box=tuple(map(tuple, bounds.tolist()))), part)}; correct it "
            "(lengths in the job's unit, places in part coordinates), or remove it"
        )

    def run(self, damage: Solid, part: Part, tolerance: float, others: Solid | None) -> Solid | None:
        """The deposit. Raises StageError where there is no room for the stock, where the damage volume lies in a region
        to keep free, or where the finished deposit does not keep a guarantee."""
        from manifold3d import Manifold

        from damageest.geometry.bubbles import fill_bubbles, find_bubbles
        from damageest.geometry.solids import subtract_lost, to_manifold, to_solid
        from damageest.geometry.touching import separate_sheets
        from damageest.stages.allowance._booleans import join, keep_touching, simplify_exactly
        from damageest.stages.allowance._cut_back import cut_back
        from damageest.stages.allowance._cut_through import describe_cut_through
        from damageest.stages.allowance._keep_out import build_keep_out
        from damageest.stages.allowance._limits import find_stock_conflict
        from damageest.stages.allowance._overlap import grow_over_rim
        from damageest.stages.allowance._skin import take_skin
        from damageest.stages.allowance._stock import build_stock
        from damageest.stages.allowance._verify import DepositGeometry, check_deposit

        origin: Floats = part.bounds.mean(axis=0)
        plan = StockPlan(self.outer, self.targets, self.keep_out)
        cavity, opening = cut_back(damage, part, others, self.inner, tolerance) if self.inner else (damage, None)
        if self.prepare is not None:
            cavity, opening = open_cavity(cavity, part, others, self.prepare, tolerance)
        crumb = max(CRUMB * damage.volume, SPECK * tolerance**3)
        if cavity is not damage:
            cavity = drop_crumbs(cavity, origin, crumb)
        hole, whole = to_manifold(cavity, origin), to_manifold(part, origin)
        left = subtract_lost(whole, hole)
        skin = take_skin(cavity, part, plan, origin)
        reach = plan.max_height + tolerance
        barred = build_keep_out(self.keep_out, skin, hole, part, plan, reach, origin, tolerance)
        band = grow_over_rim(skin, part, plan, self.overlap, tolerance, origin)
        skins = [skin] if band is None else [skin, band]
        conflicts = [
            conflict for each in skins if (conflict := find_stock_conflict(each, part, tolerance, origin)) is not None
        ]
        narrow = [found for each in conflicts if (found := each.select(~each.touches(part))) is not None]
        if narrow and self.interference == "refuse":
            raise StageError(str(narrow[0]), "use targets with a smaller outer there, keep_out, or interference: clip")
        stock = sum((build_stock(each, tolerance / 2, has_room=not conflicts) for each in skins), Manifold())
        stock = simplify_exactly(stock, part.diagonal)
        clipped = 0.0
        for body in (left, barred):
            within = stock ^ body
            # cutting off rounding errors would leave lines where the stock only touches the skin below it
            if within.volume() > MAX_DUST * stock.volume():
                clipped += within.volume() if body is left else 0.0
                stock = subtract_lost(stock, within)
        stock = keep_touching(stock, hole, tolerance)
        deposit = simplify_exactly(join(hole, stock), part.diagonal)
        filled = fill_bubbles(deposit, left + barred, part, origin)
        if filled is not deposit:  # between stock on the skin and stock that overlaps the rim
            stock, deposit = stock + (filled - deposit), filled
        thickness, doubts = check_deposit(
            DepositGeometry(deposit, hole, stock, left, barred, skin, band, origin), part, tolerance, conflicts,
            refuse=self.interference == "refuse",
        )  # fmt: skip
        milled: Solid | None = None
        if self.prepare is not None and cavity is not damage:
            milled = separate_sheets(hole - to_manifold(damage, origin), origin, tolerance)
            milled = milled and drop_crumbs(milled, origin, crumb)
        body = separate_sheets(deposit, origin, tolerance)
        if body is None:
            raise StageError("the deposit is empty", "use a slightly different outer")
        body = drop_crumbs(body, origin, crumb)
        if bubbles := find_bubbles(body, lambda: left + barred, part, origin):  # some are apart only now
            body = to_solid(sum(bubbles, to_manifold(body, origin)), origin) or body
        notes = [
            f"{conflict}; clipped there: {clipped:.4g} of stock in volume, which would lie in metal, is left out"
            for conflict in narrow[:1]
        ]
        notes += doubts
        if cavity is not damage:
            notes += describe_cut_through(damage, cavity, part, tolerance)
        notes += _describe_touching(conflicts, part)
        notes += _describe_stock(thickness, skins)
        return Deposit(
            body.vertices,
            body.faces,
            cavity=None if cavity is damage else cavity,
            milled=milled,
            stock_volume=max(body.volume - cavity.volume, 0.0),
            cut_back_volume=max(cavity.volume - damage.volume, 0.0),
            thickness=thickness,
            touched=() if part.faces_brep is None else _find_touched(part, skins),
            heights=() if part.faces_brep is None else _find_heights(part, skin),
            overlap=0.0 if band is None else self.overlap,
            notes=tuple(notes),
            opening=opening,
        )


def _describe_touching(conflicts: list[StockConflict], part: Part) -> list[str]:
    """What to say of skin that touches other metal, as in an assembly."""
    touching = [found for each in conflicts if (found := each.select(each.touches(part))) is not None]
    if not touching:
        return []
    near = ", ".join(f"{value:.4g}" for value in touching[0].points[0])
    return [
        f"no stock on skin that touches an opposite wall, within the error of the triangles: near ({near}); check it"
    ]


def _describe_stock(thickness: tuple[float, float, float] | None, skins: list[Any]) -> list[str]:
    """What to say of stock that is nowhere as high as the options ask for."""
    if thickness is None:
        return ["no stock on the skin of this damage: the deposit ends at the nominal surface; raise outer to mill it"]
    least = min(float(each.height[each.height > 0].min(initial=np.inf)) for each in skins)
    if thickness[2] >= least * (1 - 1e-6):
        return []
    if thickness[2] <= 1e-6 * least:
        return ["no room for any stock: keep_out or metal is in the way; make keep_out smaller"]
    text = f"the stock is nowhere as high as wanted: at most {thickness[2]:.4g} of {least:.4g}"
    return [f"{text}; metal, other stock or keep_out ends it; make keep_out smaller, or outer lower"]


def _find_touched(part: Part, skins: list[Any]) -> tuple[int, ...]:
    """Numbers of the CAD faces with stock."""
    assert part.faces_brep is not None
    parents = np.concatenate([skin.parent[skin.height > 0] for skin in skins])
    return tuple(np.unique(part.faces_brep[parents]).tolist())


def _find_heights(part: Part, skin: Any) -> tuple[tuple[int, float], ...]:
    """The height of the stock on each CAD face of the damage's skin; -1 where it is not the same all over it."""
    assert part.faces_brep is not None
    owner, areas = part.faces_brep[skin.parent], skin.areas
    found = []
    for number in np.unique(owner).tolist():
        own = owner == number
        values, which = np.unique(skin.height[own], return_inverse=True)
        shares = np.bincount(which.reshape(-1), weights=areas[own]) / max(float(areas[own].sum()), 1e-300)
        found.append((int(number), float(values[shares.argmax()]) if shares.max() > 1 - SLIVERS else -1.0))
    return tuple(found)
