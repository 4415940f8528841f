"""Plans layers that follow the floor of the cavity: surfaces at equal depth above it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from damageest.artefacts import Flags, Floats, Mesh
from damageest.geometry.solids import to_arrays
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.clearance.obstacles import COARSER, Obstacles
from damageest_paths.fill.fill import list_lines
from damageest_paths.fill.lines import Line
from damageest_paths.fill.regions import EVEN, cover, drop_narrow, measure_length, smooth_border
from damageest_paths.holding.reach import turn_reach
from damageest_paths.holding.shade import measure_shade
from damageest_paths.holding.sweeps import Sweeps
from damageest_paths.layering.placing import Placing
from damageest_paths.layering.planar import SHORT, UNSUPPORTED, Surroundings, crop_metal
from damageest_paths.layering.unfilled import Unfilled
from damageest_paths.process.frames import Frame
from damageest_paths.process.process import Pass, Plan, Process
from damageest_paths.sheets.floor import Floor, list_floors
from damageest_paths.sheets.patches import Patch, list_patches
from damageest_paths.sheets.sheets import (
    FINE,
    Grid,
    Sheet,
    lay_ground,
    lay_sheet,
    make_grid,
    measure_reach,
    measure_support,
)
from damageest_paths.travel.order import order_passes

NO_FLOOR = "no side of it that lies on metal faces the build direction"
STEPS = "the floor of the cavity has steps, and no even layer goes over them"
BENDS = "the layers bend too much both ways: beads laid side by side would lie far too close"
MOST_LOST = 0.5
"""Share of a body of which layers along the floor may leave no more; another plan reaches little of so much."""
UNCOVERED = 0.05
"""Share of a body that no layer over a floor covers up to which this floor is followed before another is laid out."""
LOST = "layers that follow the floor of the cavity would leave more than half of it without a bead"
SPARE = 0.02
"""Share of a layer's height that is not worth another layer: the facets of a round floor are off by as much."""
THIN = 0.01
"""Share of the layer height up to which what reaches into a layer is left out."""


NARROW = 0.5
"""Half of the bead widths of what is too narrow for the middles of beads."""
SCRAP = 1.5
"""Bead widths of a pass that are not worth a start beside a longer one."""


class Layer(NamedTuple):
    """The top of a layer, how far (N,) the deposit is from each place of it, and its pieces in planes."""

    sheet: Sheet
    reach: Floats
    patches: list[Patch]


class NotFollowedError(Exception):
    """No even layers can follow the floor; the message says why."""


def plan_conformal(
    body: Any,
    frame: Frame,
    around: Surroundings,
    process: Process,
    most_lost: float = MOST_LOST,
    find_other: Callable[[float], Plan | None] = lambda least: None,
) -> Plan:
    """Passes that build up a body, a Manifold relative to the frame's origin, in layers along the cavity's floor.

    The top of each layer is a surface at equal distance above the floor, its passes are drawn in the plane into which
    it is unrolled. All layers have one height, at most the process's, so that the last ends with the thickest place.
    A place is built where metal or a pass of the layer below is near enough. Where the floor cannot be followed,
    or more than the share ``most_lost`` would be left, nothing is planned, and the reason says why.

    ``find_other``: is asked once layers are laid out, before beads are, for a plan that leaves less than the volume
    that no layer covers; that is taken then.
    """
    process = replace(process, reach=turn_reach(process.reach, frame))
    if not isinstance(process.starts, str):
        process = replace(process, starts=frame.to_local(process.starts))
    local, metal = frame.move(body), frame.move(around.metal)
    corners = np.array([local.bounding_box()[:3], local.bounding_box()[3:]])
    plan = Plan(frame, process.height, (), local, {NO_FLOOR: float(local.volume())})
    places, margin = to_arrays(local.refine_to_length(process.bead.width))[0], process.bead.width + 2 * process.height
    near = Mesh(*to_arrays(crop_metal(metal, local, margin, margin, margin)))
    standing: Sweeps | None = None
    waiting: list[tuple[_Work, list[Layer]]] = []
    for floor, torn in list_floors(local, metal, process):
        standing = standing or Sweeps(around.measure_from(body, frame, COARSER * process.bead.width))
        thickest = float(floor.measure(places).distance.max())
        count = max(1, int(np.ceil(thickest / process.height - SPARE)))
        height = min(thickest / count, process.height)
        grid = make_grid(floor, places, process)
        unfilled = Unfilled(local, process.bead.width, height)
        work = _Work(local, near, floor, standing, process, grid, corners, height, torn, unfilled)
        try:
            layers = work.lay_out(count)
        except NotFollowedError as error:
            plan = _refuse(frame, local, height, error)
            continue
        other = find_other(unfilled.volume)
        if other is not None:
            return other
        if unfilled.volume > UNCOVERED * local.volume():
            waiting.append((work, layers))
            continue
        plan = work.fill(frame, layers, most_lost)
        if plan.passes:
            return plan
    # where all leave much uncovered, that which leaves least is filled first
    for work, layers in sorted(waiting, key=lambda one: one[0].unfilled.volume):
        plan = work.fill(frame, layers, most_lost)
        if plan.passes:
            return plan
    return plan


def _refuse(frame: Frame, local: Any, height: float, error: NotFollowedError) -> Plan:
    return Plan(frame, height, (), local, {str(error): float(local.volume())})


@dataclass(eq=False)
class _Work:
    """What is planned of a body. ``near``: the metal round it; ``corners`` (2,3) of its box. ``torn``: share of the
    layers that may be torn where they have steps or bend too much. ``stack``: the layers so far."""

    body: Any
    near: Mesh
    floor: Floor
    standing: Sweeps
    process: Process
    grid: Grid
    corners: Floats
    height: float
    torn: float
    unfilled: Unfilled
    passes: list[Pass] = field(default_factory=list)
    layer: list[Pass] = field(default_factory=list)
    stack: list[tuple[Sheet, Floats]] = field(default_factory=list)

    def lay_out(self, count: int) -> list[Layer]:
        """The layers from the floor up. What none of them covers is missing. Raises NotFollowedError."""
        layers = self._list_layers(count)
        for number, layer in enumerate(layers):
            for patch in layer.patches:
                self.unfilled.cover(patch, patch.draw_region(layer.reach, self.process), is_first=not number)
        self.unfilled.add_rest()
        return layers

    def fill(self, frame: Frame, layers: Sequence[Layer], most_lost: float) -> Plan:
        """The plan with the passes of the layers; without any where these leave too much."""
        try:
            self._fill_layers(layers, most_lost)
        except NotFollowedError as error:
            return _refuse(frame, self.body, self.height, error)
        return Plan(frame, self.height, tuple(self.passes), *self.unfilled.join())

    def _fill_layers(self, layers: Sequence[Layer], most_lost: float) -> None:
        self._require_enough(most_lost)
        width = self.process.bead.width
        for number, (sheet, reach, patches) in enumerate(layers):
            lines = [one.points for one in self.layer]
            lean = self.height * np.tan(self.process.overhang)
            some = np.flatnonzero(reach < width)
            held = measure_support(sheet, some, self.near, lines, width / 2, self.height, lean - 3 * FINE * width)
            self.stack.append((sheet, reach))
            around = [self.standing, self._place_top(self.stack, self.standing.clearance.without_beam())]
            if number:
                # beads of the same layer lie beside the beam; where their border rises, it would stand in it
                around.append(self._place_top(self.stack[:-1], self.standing.clearance))
            self.layer = []
            shade = measure_shade(sheet, reach, self.near, self.height, self.process)
            for patch in patches:
                self._fill_patch(patch, number, reach, held - lean, shade, around)
            before = self.passes[-1] if self.passes else None
            self.passes += order_passes(self.layer, before, self.standing.clearance, self.process)
            self._require_enough(most_lost)

    def _require_enough(self, most_lost: float) -> None:
        if self.unfilled.volume > min(most_lost * self.body.volume(), self.process.give_up):
            raise NotFollowedError(LOST)

    def _list_layers(self, count: int) -> list[Layer]:
        solid = Mesh(*to_arrays(self.body))
        sheet = lay_ground(self.floor, self.grid)
        spacing = 3 * FINE * self.process.bead.width
        found, steps, bends = [], 0.0, 0.0
        most = self.torn * float(self.body.volume()) / self.height
        for number in range(count):
            sheet = lay_sheet(self.floor, self.grid, sheet, (number + 1) * self.height, self.process, self.height)
            reach = measure_reach(sheet, solid, self.height, spacing) + THIN * self.height
            unrolling = list_patches(sheet, self.grid, reach, self.floor, self.process)
            steps, bends = steps + unrolling.steps, bends + unrolling.bends
            if steps + bends > most:
                raise NotFollowedError(STEPS if steps > bends else BENDS)
            found.append(Layer(sheet, reach, unrolling.patches))
        return found

    def _place_top(self, stack: Sequence[tuple[Sheet, Floats]], clearance: Clearance) -> Sweeps:
        """The distances to the sheets of a stack of layers."""
        top = self._gather_top(stack)
        meshes = [top] if len(top.faces) else []
        above = Obstacles(meshes, self.corners[0], self.corners[1], self.process.bead.width, coarser=COARSER)
        return Sweeps(clearance.with_obstacles(above))

    def _gather_top(self, stack: Sequence[tuple[Sheet, Floats]]) -> Mesh:
        """The sheets of these layers as a mesh, as far as beads lie under them and no other layer on them."""
        half = self.process.bead.width / 2
        vertices, faces = [], []
        for k, (sheet, reach) in enumerate(stack):
            shown: Flags = sheet.is_found & (reach < half)
            coarse = self.grid.coarse
            own = coarse[shown[coarse].any(axis=1) & sheet.is_found[coarse].all(axis=1)]
            if k + 1 < len(stack):
                own = own[(stack[k + 1][1][own] > -2 * half).any(axis=1)]
            vertices.append(sheet.points)
            faces.append(own + k * len(reach))
        used, number = np.unique(np.concatenate(faces), return_inverse=True)
        return Mesh(np.concatenate(vertices)[used], number.reshape(-1, 3))

    def _fill_patch(
        self,
        patch: Patch,
        layer: int,
        reach: Floats,
        support: Floats,
        shade: Floats | None,
        around: Sequence[Sweeps],
    ) -> None:
        process = self.process
        wanted = patch.draw_region(reach, process)
        held = wanted ^ patch.draw_region(support, process)
        angle = process.angle + layer * process.turn
        style = process.choose_style(layer)
        if not isinstance(process.starts, str):
            style = style._replace(start=patch.find_direction(process.starts))
        free, width = None, process.bead.width
        if shade is not None:
            free = drop_narrow(patch.draw_region(shade, process), NARROW * width).simplify(EVEN * width)
        draw = partial(
            _draw_long, pattern=process.pattern, bead=process.bead, angle=angle, free=free, shortest=process.shortest,
            style=style,
        )  # fmt: skip
        place = Placing(patch, layer, around, process, self.standing.clearance.reach)
        long, short = draw(smooth_border(held, width))
        placed = place.place(long)
        if placed.is_torn(len(long)):
            placed = place.share_out(placed, long, held, lambda part: draw(part)[0])
        self.layer += placed.passes
        done, dropped = placed.done, {**placed.dropped, SHORT: short}
        gaps = held - cover(done, process.bead.width)
        left_out = {UNSUPPORTED: wanted - held}
        for why, lines_left in dropped.items():
            left_out[why] = cover(lines_left, process.bead.width) ^ gaps
            gaps -= left_out[why]
        self.unfilled.add_below(patch, left_out, is_first=not layer)


def _draw_long(region: Any, **options: Any) -> tuple[list[Line], list[Floats]]:
    """The lines that fill a region and are worth a start, and the points of the others; ``options`` of `list_lines`."""
    lines = list_lines(region, **options)
    scrap = SCRAP * options["bead"].width
    longest = max((measure_length(line.points) for line in lines), default=0.0)
    least = max(options["shortest"], scrap if longest > scrap else 0.0)
    long = [line for line in lines if measure_length(line.points) >= least]
    return long, [line.points for line in lines if measure_length(line.points) < least]
