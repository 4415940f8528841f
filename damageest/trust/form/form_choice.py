"""Which form explains the scan: the part as designed, another scale, or a part that is bent, twisted or sheared."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from damageest.artefacts import Flags, Floats, Part
from damageest.geometry.neighbourhoods import pick_one_per_cube
from damageest.geometry.voxels import number_cubes
from damageest.trust.form.form_fields import BENDS, EVERY, LEANS, SCALE, SHEARS, STRETCHES, TWISTS, Field, choose_frame
from damageest.trust.form.form_fit import (
    Cells,
    Feet,
    Form,
    Skin,
    find_feet,
    improve,
    make_motion,
    measure_cost,
    solve_cells,
    weigh,
)

MOST_POINTS, FEW_POINTS = 14_000, 5_000
"""Points that the last steps of a fit use, and those before it."""
PER_CELL = 4.0
"""Edge of a cell, in mean distances of the points of the last steps."""
REACH = 15.0
"""Distance from the skin, in tolerances, up to which points are used."""
WIDTHS = (8.0, 5.0, 3.0, 2.0, 1.2, 0.7)
"""Widths of the kernel, in tolerances, one after the other; then the last one."""
NARROWEST, BY_NOISE = 0.3, 1.25
"""The last width: the larger of these, in tolerances and in standard deviations of the noise."""
MOST_OUTSIDE, LEAST_OUTSIDE = 0.02, 0.5
"""Share of the skin that lies outside the rigid part by more than the second, in tolerances, from which all fields are
also fitted from wide kernels on."""
KEPT = 0.5
"""Share of the points near the skin that have to stay there after a step."""
BLOCKS, FOLDS = 6, 4
"""Blocks along the part's diagonal that cells are left out by, and the folds that these are dealt to."""
LEAST_GAIN = 0.015
"""Cost, of the scale of `measure_cost`, that a form has to explain beyond the rigid motion."""
LEAST_SHARE = 0.5
"""Share of that cost which it has to explain also where it was not fitted."""
NEARLY = 0.12
"""Share of what the richest form explains that a simpler one may leave."""

_SETS: tuple[tuple[str, tuple[Field, ...]], ...] = (
    ("rigid", ()),
    ("scale", SCALE),
    ("stretch", STRETCHES),
    *((f"twist {a}", (TWISTS[a],)) for a in range(3)),
    *((f"bend {one.along}{one.across}", (one,)) for one in BENDS),
    *((f"bend and lean {one.along}{one.across}", (one, LEANS[k])) for k, one in enumerate(BENDS)),
    *((f"bends {a}", tuple(one for one in (*BENDS, *LEANS) if one.along == a)) for a in range(3)),
    *((f"bends and twist {a}", (*(o for o in (*BENDS, *LEANS) if o.along == a), TWISTS[a])) for a in range(3)),
    ("affine", (*STRETCHES, *SHEARS)),
    *((f"scale and bends {a}", (*SCALE, *(o for o in BENDS if o.along == a), TWISTS[a])) for a in range(3)),
    ("every", EVERY),
)
CANDIDATES = dict(_SETS)
"""The forms that are tried, the simplest first."""


@dataclass(frozen=True, eq=False)
class FormChoice:
    """The ``form`` that explains the scan, and the ``rigid`` one. ``cells``: what is left in the cells of the skin
    after the form, ``rigid_cells``: after the rigid motion.

    ``scale``: the form with the one scale that fits best, ``stretch``: with one for each axis, whether they are needed
    or not, and ``every``: of all fields. ``name``: of `CANDIDATES`. ``gain``: the cost that the form explains beyond
    the rigid motion, and ``kept``, where it was not fitted. ``costs``: of the candidates that were tried. ``width``: of
    the kernel. ``feet``: the points that the form was fitted to.
    """

    name: str
    form: Form
    rigid: Form
    scale: Form
    stretch: Form
    every: Form
    cells: Cells
    rigid_cells: Cells
    gain: float
    kept: float
    costs: dict[str, float]
    width: float
    feet: Feet


@dataclass(frozen=True, eq=False)
class _Task:
    skin: Skin
    tolerance: float
    width: float
    edge: float

    def find_feet(self, form: Form, points: Floats) -> Feet:
        return find_feet(self.skin, form, points, self.edge, REACH * self.tolerance, self.tolerance)

    def fit(self, form: Form, widths: tuple[float, ...], points: Floats, rounds: int = 2) -> Form:
        """Fits a form with ever narrower kernels, the nearest places searched again for each.

        It ends where a step takes most points off the skin: too little skin was seen to hold the form.
        """
        held, least = form, 0.0
        for width in widths:
            feet = self.find_feet(form, points)
            if len(feet.points) < least:
                return held
            held, least = form, KEPT * len(feet.points)
            for _ in range(rounds):
                cells = feet.summarise(form)
                if len(cells.count) < 30:
                    return form
                form = improve(form, cells, max(width * self.tolerance, self.width), self.tolerance)
        return form


def choose_form(part: Part, points: Floats, distance: Floats, noise: float, tolerance: float) -> FormChoice | None:
    """The simplest form that explains the points (N,3) of the scan in the part's frame, with their signed ``distance``
    (N,); None where there are too few points near the skin.

    All fields are fitted at first, with a kernel that narrows (graduated non-convexity, Blake and Zisserman 1987). What
    simpler forms leave is then found from the linear equations of that fit.
    """
    near = points[np.abs(distance) < REACH * tolerance]
    if len(near) < 300:
        return None
    gap = float(np.sqrt(part.area / MOST_POINTS))
    every = near[pick_one_per_cube(near, gap)]
    few = every[:: max(1, len(every) // FEW_POINTS)]
    task = _Task(Skin.build(part), tolerance, max(NARROWEST * tolerance, BY_NOISE * noise), PER_CELL * gap)
    start = Form.rigid(choose_frame(part, every))
    rigid = task.fit(start, WIDTHS[3:], few)
    starts = [task.fit(rigid.with_fields(EVERY), WIDTHS[4:], few)]
    if _measure_outside(task.find_feet(rigid, few).summarise(rigid), tolerance) > MOST_OUTSIDE:
        starts.append(task.fit(start.with_fields(EVERY), WIDTHS, few))
    found = [_measure(task.find_feet(one, few).summarise(one), task.width) for one in starts]
    rich = task.fit(starts[int(np.argmin(found))], (0.0,), every)
    at = task.find_feet(rich, every)
    cells = at.summarise(rich)
    if len(cells.count) < 30:
        return None
    forms: dict[str, Form] = {}
    costs: dict[str, float] = {}
    names = ("rigid", "every", "scale", "stretch", *CANDIDATES)
    for name in names:
        if name not in costs and (len(costs) < 4 or costs["rigid"] - costs["every"] > LEAST_GAIN):
            forms[name], costs[name] = _reduce(task, rich, cells, CANDIDATES[name])
    full = costs["rigid"] - costs["every"]
    name = next(
        name
        for name in CANDIDATES
        if name in costs and costs[name] <= costs["every"] + max(NEARLY * full, LEAST_GAIN / 2)
    )
    gain, kept = costs["rigid"] - costs[name], 0.0
    if name != "rigid":
        kept = _cross_validate(task, rich, cells, CANDIDATES[name])
    if gain < LEAST_GAIN or kept < LEAST_SHARE * gain:
        name = "rigid"
    form = forms[name]
    if name != "rigid":
        refined = task.fit(form, (0.0,), every)
        after = task.find_feet(refined, every)
        if len(after.points) > KEPT * len(at.points):
            form, at = refined, after
        else:
            name, form = "rigid", forms["rigid"]
    scale = form if name == "scale" else forms["scale"]
    return FormChoice(
        name, form, forms["rigid"], scale, forms["stretch"], rich, at.summarise(form), at.summarise(forms["rigid"]),
        gain, kept, costs, task.width, at,
    )  # fmt: skip


def _measure_outside(cells: Cells, tolerance: float) -> float:
    """Share of the skin that lies outside the part by more than noise, where no loss puts it."""
    outside = cells.offset > LEAST_OUTSIDE * tolerance
    return float(cells.count[outside].sum() / max(float(cells.count.sum()), 1.0))


def _measure(cells: Cells, width: float) -> float:
    return measure_cost(cells.offset, cells.count, width)


def _select(fields: tuple[Field, ...]) -> Floats:
    """(6+E,6+K): the coefficients of all fields that those of some fields stand for."""
    chosen = np.zeros((6 + len(EVERY), 6 + len(fields)))
    chosen[:6, :6] = np.eye(6)
    for k, field in enumerate(fields):
        for one in STRETCHES if field.kind == "scale" else (field,):
            chosen[6 + EVERY.index(one), 6 + k] = 1.0
    return chosen


def _solve(
    task: _Task, rich: Form, cells: Cells, fields: tuple[Field, ...], used: Flags
) -> tuple[Floats, Floats, Floats]:
    """The motion and coefficients (6+K,) of some fields, their covariance, and what they leave in all cells (C,)."""
    J = cells.jacobian @ _select(fields)
    known = np.concatenate([np.zeros(6), rich.coefficients])
    base = cells.offset - cells.jacobian @ known  # of a part without any field
    starts = [np.linalg.lstsq(_select(fields), known, rcond=None)[0], np.zeros(6 + len(fields))]
    best: tuple[float, Floats, Floats] | None = None
    for value in starts:
        covariance = np.eye(len(value))
        for width in (8.0, 3.0, 1.5, 0.7, 0.0, 0.0, 0.0):
            wide = max(width * task.tolerance, task.width)
            offset = base + J @ value
            weight = cells.count * weigh(offset, wide, not fields) * used
            step, covariance = solve_cells(J, offset, weight, cells.count, wide, task.tolerance)
            value = value + step
        cost = measure_cost((base + J @ value)[used], cells.count[used], task.width)
        if best is None or cost < best[0]:
            best = (cost, value, covariance)
    assert best is not None
    return best[1], best[2], base + J @ best[1]


def _reduce(task: _Task, rich: Form, cells: Cells, fields: tuple[Field, ...]) -> tuple[Form, float]:
    """The best form of some of the fields, and its cost."""
    value, covariance, offset = _solve(task, rich, cells, fields, np.ones(len(cells.count), bool))
    form = replace(
        rich,
        T=make_motion(value[:6], rich.frame) @ rich.T,
        fields=fields,
        coefficients=value[6:],
        covariance=covariance,
    )
    return form, measure_cost(offset, cells.count, task.width)


def _cross_validate(task: _Task, rich: Form, cells: Cells, fields: tuple[Field, ...]) -> float:
    """The cost that some fields explain beyond the rigid motion, in blocks of the part that they were not fitted to."""
    block = number_cubes(cells.place, 2 * rich.frame.half / BLOCKS)[1]
    fold = np.unique(block, return_inverse=True)[1] * 7919 % FOLDS
    gain = 0.0
    for number in range(FOLDS):
        out = fold == number
        if not out.any() or out.all():
            continue
        rigid, other = (
            measure_cost(_solve(task, rich, cells, chosen, ~out)[2][out], cells.count[out], task.width)
            for chosen in ((), fields)
        )
        gain += (rigid - other) * float(cells.count[out].sum() / cells.count.sum())
    return gain
