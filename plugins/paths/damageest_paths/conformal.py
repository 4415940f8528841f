"""Plans layers that follow the floor of the cavity: surfaces at equal depth above it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from damageest.artefacts import Flags, Floats, Mesh
from damageest.geometry.solids import to_arrays, to_manifold
from damageest_paths.fill import Line, list_lines
from damageest_paths.floor import Floor, list_floors
from damageest_paths.follow import follow_line, limit_tilt, make_pass
from damageest_paths.frames import Frame
from damageest_paths.obstacles import COARSER, Obstacles
from damageest_paths.order import order_passes
from damageest_paths.patches import Patch, list_patches
from damageest_paths.planar import COLLIDES, SHADED, SHORT, UNSUPPORTED, Surroundings
from damageest_paths.process import Pass, Plan, Process, extend_line
from damageest_paths.regions import cover, measure_length, resample, shift_border
from damageest_paths.sheets import (
    FINE,
    Grid,
    Sheet,
    lay_ground,
    lay_sheet,
    make_grid,
    measure_reach,
    measure_support,
)
from damageest_paths.sweeps import Sweeps

NO_FLOOR, BESIDE = (
    "no side of it that lies on metal faces the build direction",
    "lies beside or below the floor that the layers follow, or at a step of theirs",
)
STEPS = "the floor of the cavity has steps, and no even layer goes over them"
BENDS = "the layers bend too much both ways: beads laid side by side would lie far too close"
MOST_LOST = 0.5
"""Share of a body of which layers along the floor may leave no more; another plan reaches little of so much."""
LOST = "layers that follow the floor of the cavity would leave more than half of it without a bead"
SPARE = 0.02
"""Share of a layer's height that is not worth another layer: the facets of a round floor are off by as much."""
SLIVER = 0.05
"""Least thickness and volume of what no layer covers, in layer heights and in lengths of bead as long as it is wide."""
GROWN, DEEPER = 0.1, 0.5
"""Shares of a bead's width and height by which layers are taken to be wider and deeper when it is looked for: below a
crease of the floor it is farther than one height to the layer below."""
FIRST = 2.0
"""Layer heights by which the first layer is taken to reach down: to the floor wherever that is."""
ROUGH = 0.02
"""Share of a bead's width within which the borders of what has no bead are simplified."""
THIN = 0.01
"""Share of the layer height up to which what reaches into a layer is left out."""


class NotFollowedError(Exception):
    """No even layers can follow the floor; the message says why."""


def plan_conformal(
    body: Any, frame: Frame, around: Surroundings, process: Process, most_lost: float = MOST_LOST
) -> Plan:
    """Passes that build up a body, a Manifold relative to the frame's origin, in layers along the cavity's floor.

    The top of each layer is a surface at equal distance above the floor, its passes are drawn in the plane into which
    it is unrolled. All layers have one height, at most the process's, so that the last ends with the thickest place.
    A place is built where metal or a pass of the layer below is near enough. Where the floor cannot be followed,
    or more than the share ``most_lost`` would be left, nothing is planned, and the reason says why.
    """
    local, metal = frame.move(body), frame.move(around.metal)
    corners = np.array([local.bounding_box()[:3], local.bounding_box()[3:]])
    plan = Plan(frame, process.height, (), local, {NO_FLOOR: float(local.volume())})
    places, near = to_arrays(local.refine_to_length(process.bead.width))[0], _crop(metal, corners, process)
    standing: Sweeps | None = None
    for floor, torn in list_floors(local, metal, process):
        standing = standing or _gather_metal(metal, frame, around, corners, process)
        thickest = float(floor.measure(places).distance.max())
        count = max(1, int(np.ceil(thickest / process.height - SPARE)))
        height = min(thickest / count, process.height)
        work = _Work(local, near, floor, standing, process, height, torn)
        try:
            work.build(count, places, most_lost)
            return Plan(frame, height, tuple(work.passes), *work.join_missing())
        except NotFollowedError as error:
            plan = Plan(frame, height, (), local, {str(error): float(local.volume())})
    return plan


def _gather_metal(metal: Any, frame: Frame, around: Surroundings, corners: Floats, process: Process) -> Sweeps:
    """What the nozzle must not touch: the metal, a Manifold in local coordinates, and the other meshes."""
    meshes = [Mesh(*to_arrays(metal))]
    meshes += [Mesh(frame.to_local(mesh.vertices + frame.origin), mesh.faces) for mesh in around.others]
    near = Obstacles(meshes, corners[0], corners[1], process.bead.width, coarser=COARSER)
    return Sweeps(around.clearance.with_obstacles(near))


def _crop(metal: Any, corners: Floats, process: Process) -> Mesh:
    """What lies of the metal in the box round the body."""
    from manifold3d import Manifold

    margin = process.bead.width + 2 * process.height
    low, high = corners[0] - margin, corners[1] + margin
    return Mesh(*to_arrays(metal ^ Manifold.cube(tuple(high - low)).translate(tuple(low))))


@dataclass(eq=False)
class _Work:
    """What is planned of a body. ``near``: the metal round it. ``torn``: share of the layers that may be torn
    where they have steps or bend too much. ``stack``: triangles of the layers below that are not covered by another.
    ``missing``: what has no bead, in pieces that hardly overlap; ``volumes``: theirs by reason."""

    body: Any
    near: Mesh
    floor: Floor
    standing: Sweeps
    process: Process
    height: float
    torn: float
    passes: list[Pass] = field(default_factory=list)
    layer: list[Pass] = field(default_factory=list)
    missing: list[Any] = field(default_factory=list)
    volumes: dict[str, float] = field(default_factory=dict)
    stack: list[tuple[Sheet, Floats]] = field(default_factory=list)
    covered: list[Any] = field(default_factory=list)

    def build(self, count: int, places: Floats, most_lost: float) -> None:
        """Plans the layers from the floor up. ``places`` (K,3): see `make_grid`. Raises NotFollowedError where that
        cannot be, or leaves too much."""
        grid = make_grid(self.floor, places, self.process)
        low, high = places.min(axis=0), places.max(axis=0)
        width = self.process.bead.width
        # all layers are laid out before the first is filled: what cannot be followed is refused without that
        layers = self._lay_out(count, grid)
        for number, (_, reach, patches) in enumerate(layers):
            for patch in patches:
                self._cover(patch, number, reach)
        self._add_rest()
        for number, (sheet, reach, patches) in enumerate(layers):
            lines = [one.points for one in self.layer]
            lean = self.height * np.tan(self.process.overhang)
            some = np.flatnonzero(reach < width)
            held = measure_support(sheet, some, self.near, lines, width / 2, self.height, lean - 3 * FINE * width)
            self.stack.append((sheet, reach))
            top = self._gather_top(grid)
            meshes = [top] if len(top.faces) else []
            above = Obstacles(meshes, low, high, width, coarser=COARSER)
            around = [self.standing, Sweeps(self.standing.clearance.with_obstacles(above))]
            self.layer = []
            for patch in patches:
                self._fill_patch(patch, number, reach, held - lean, around)
            before = self.passes[-1] if self.passes else None
            self.passes += order_passes(self.layer, before, self.standing.clearance, self.process)
            self._require_enough(most_lost)

    def _require_enough(self, most_lost: float) -> None:
        if sum(self.volumes.values()) > most_lost * self.body.volume():
            raise NotFollowedError(LOST)

    def _lay_out(self, count: int, grid: Grid) -> list[tuple[Sheet, Floats, list[Patch]]]:
        """The tops of the layers, how far the deposit is from each place of them, and the patches that are unrolled.
        Raises NotFollowedError."""
        solid = Mesh(*to_arrays(self.body))
        sheet = lay_ground(self.floor, grid)
        spacing = 3 * FINE * self.process.bead.width
        found, steps, bends = [], 0.0, 0.0
        most = self.torn * float(self.body.volume()) / self.height
        for number in range(count):
            sheet = lay_sheet(self.floor, grid, sheet, (number + 1) * self.height, self.process, self.height)
            reach = measure_reach(sheet, solid, self.height, spacing) + THIN * self.height
            unrolling = list_patches(sheet, grid, reach, self.floor, self.process)
            steps, bends = steps + unrolling.steps, bends + unrolling.bends
            if steps + bends > most:
                raise NotFollowedError(STEPS if steps > bends else BENDS)
            found.append((sheet, reach, unrolling.patches))
        return found

    def _cover(self, patch: Patch, layer: int, reach: Floats) -> None:
        """Notes what lies in a layer below what is wanted of it."""
        width = self.process.bead.width
        wider = shift_border(patch.draw_region(reach, self.process), GROWN * width)
        if not wider.is_empty():
            deep = self.height * (1 + DEEPER) if layer else FIRST * self.height
            self.covered.append(patch.fill_below(wider, deep, width / 2))

    def _add_rest(self) -> None:
        """What no layer covers is missing too, as below the planes in which the floor goes on."""
        from manifold3d import Manifold, OpType

        rest = Manifold.batch_boolean([self.body, *self.covered], OpType.Subtract)
        smallest = SLIVER * self.process.bead.width**2 * self.height
        for piece in rest.decompose():
            # thin skins are where a layer's border is not exact
            if piece.volume() > max(smallest, SLIVER * self.height * piece.surface_area()):
                self._add_piece(piece, {BESIDE: 1.0})

    def _gather_top(self, grid: Grid) -> Mesh:
        """The sheets of all layers as a mesh, as far as beads lie under them and no other layer on them."""
        half = self.process.bead.width / 2
        vertices, faces = [], []
        for k, (sheet, reach) in enumerate(self.stack):
            shown: Flags = sheet.is_found & (reach < half)
            own = grid.coarse[shown[grid.coarse].any(axis=1) & sheet.is_found[grid.coarse].all(axis=1)]
            if k + 1 < len(self.stack):
                own = own[(self.stack[k + 1][1][own] > -2 * half).any(axis=1)]
            vertices.append(sheet.points)
            faces.append(own + k * len(reach))
        used, number = np.unique(np.concatenate(faces), return_inverse=True)
        return Mesh(np.concatenate(vertices)[used], number.reshape(-1, 3))

    def _fill_patch(self, patch: Patch, layer: int, reach: Floats, support: Floats, around: Sequence[Sweeps]) -> None:
        process = self.process
        wanted = patch.draw_region(reach, process)
        held = wanted ^ patch.draw_region(support, process)
        angle = process.angle + layer * process.turn
        lines = list_lines(held, process.pattern, process.bead, angle, None, process.shortest)
        long = [line for line in lines if measure_length(line.points) >= process.shortest]
        short = [line.points for line in lines if measure_length(line.points) < process.shortest]
        done: list[Floats] = []
        dropped: dict[str, list[Floats]] = {COLLIDES: [], SHADED: [], SHORT: short}
        for line in long:
            made, left = self._place(patch, line, layer, around)
            done += made
            for why, piece in left:
                dropped[why].append(piece)
        gaps = held - cover(done, process.bead.width)
        left_out = {UNSUPPORTED: wanted - held}
        for why, lines_left in dropped.items():
            left_out[why] = cover(lines_left, process.bead.width) ^ gaps
            gaps -= left_out[why]
        self._add_missing(patch, left_out, layer)

    def _place(
        self, patch: Patch, line: Line, layer: int, around: Sequence[Sweeps]
    ) -> tuple[list[Floats], list[tuple[str, Floats]]]:
        """Adds the passes along a line of the plane. Gives the pieces with a bead (K,2), and those without, each with
        the reason."""
        process = self.process
        places, _ = resample(extend_line(line.points, *process.extend), process.step)
        points, normals, _ = patch.tree.find(places)
        least = min(int(np.ceil(process.shortest / process.step)) + 2, len(points))
        runs = follow_line(points, normals, around, process, least)
        runs = [run for run in runs if measure_length(points[run.start : run.stop]) >= process.shortest]
        reach = self.standing.clearance.reach
        made = [make_pass(points, normals, run, layer, process, reach) for run in runs]
        self.layer += [replace(one, kind=line.kind) for one in made]
        stops = [0, *(k for run in runs for k in (run.start, run.stop)), len(places)]
        spans = [(max(a - 1, 0), b + 1) for a, b in zip(stops[::2], stops[1::2], strict=True) if b > a]
        left = []
        for a, b in spans:
            body = [part.clearance.without_beam() for part in around]
            upright = limit_tilt(normals[a:b], process.tilt if process.axes == 5 else 0.0)
            free = all((one.bound(points[a:b], upright, process.gap)[0] >= process.gap).mean() > 0.5 for one in body)
            left.append((SHADED if free else COLLIDES, places[a:b]))
        return [places[run.start : run.stop] for run in runs], left

    def _add_missing(self, patch: Patch, regions: dict[str, Any], layer: int) -> None:
        """Adds what has no bead below regions of the plane, by reason."""
        from manifold3d import CrossSection, OpType

        width = self.process.bead.width
        areas = {why: region.area() for why, region in regions.items()}
        whole = CrossSection.batch_boolean(list(regions.values()), OpType.Add).simplify(ROUGH * width)
        if whole.is_empty() or sum(areas.values()) <= 0:
            return
        piece = self.body ^ patch.fill_below(whole, self.height * (1 if layer else FIRST), width / 2)
        self._add_piece(piece, areas)

    def _add_piece(self, piece: Any, shares: dict[str, float]) -> None:
        """Adds a piece, with its volume by reason in these proportions."""
        if piece.volume() > 0:
            each = piece.volume() / sum(shares.values())
            for why, share in shares.items():
                self.volumes[why] = self.volumes.get(why, 0.0) + each * share
            self.missing.append(_renew(piece))

    def join_missing(self) -> tuple[Any, dict[str, float]]:
        """All that is missing, as a Manifold, None for nothing; and the volume by reason."""
        from manifold3d import Manifold, OpType

        if not self.missing:
            return None, {}
        whole = _renew(Manifold.batch_boolean(self.missing, OpType.Add))
        share = whole.volume() / sum(self.volumes.values())
        return whole, {why: share * volume for why, volume in self.volumes.items()}


def _renew(body: Any) -> Any:
    """The same solid without what manifold3d knows of the ones that it was made of: unions of solids that nearly
    coincide, made one after the other, take all memory with that (3.5.4)."""
    return to_manifold(Mesh(*to_arrays(body)))
