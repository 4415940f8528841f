"""Plans layers that are planes across the build direction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh
from damageest.geometry.solids import to_arrays
from damageest_paths.clearance.axes import Limits, Piece, choose_axes, list_axes
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.clearance.obstacles import Obstacles
from damageest_paths.fill.fill import SLIVER, WITHIN, list_lines
from damageest_paths.fill.lines import Kind, Line
from damageest_paths.fill.regions import (
    cover,
    list_pieces,
    make_region,
    measure_length,
    resample,
    shift_border,
    unite_regions,
)
from damageest_paths.holding.reach import is_reached, turn_reach
from damageest_paths.layering.aims import DOWN, UP, Aims, cast_shadow, find_aims, find_sink, measure_margin
from damageest_paths.layering.anchor import find_foot
from damageest_paths.process.frames import Frame
from damageest_paths.process.process import Pass, Plan, Process, extend_line
from damageest_paths.travel.order import order_passes

UNSUPPORTED, COLLIDES, SHORT, SUNK, SHADED = (
    "stands on nothing within the permitted overhang",
    "the nozzle would come too near to something",
    "shorter than the shortest pass",
    "so thin over intact metal that a bead would lie in it",
    "no line of sight: something stands between nozzle and bead, or the tool would be too oblique",
)
ROOTED, ROOM = 1.9, 0.48
"""How many times as deep beads of the first layer may lie in intact metal at their sides, where else there is no
room of this many bead widths to both sides."""
OFF = 0.1
"""Bead widths by which the middle of a bead may lie beside what a layer has to fill."""
Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What the nozzle must not touch, relative to the frame's origin. ``metal``: a Manifold of what is left of the part
    and stands already. ``others``: meshes. ``nozzle``: see `Clearance`."""

    metal: Any
    others: Sequence[Mesh]
    clearance: Clearance
    _prepared: dict[tuple[float, ...], Obstacles] = field(default_factory=dict, init=False, repr=False)

    def measure_from(self, body: Any, frame: Frame, width: float) -> Clearance:
        """The distances, near a body, a Manifold, to what the nozzle must not touch, in the frame's coordinates.

        ``width``: see `Obstacles`. The tree of triangles takes long: one serves all directions of a body.
        """
        key = (width, *map(float, body.bounding_box()))
        if key not in self._prepared:
            meshes = [Mesh(*to_arrays(self.metal))] if not self.metal.is_empty() else []
            box = np.array(key[1:])
            self._prepared[key] = Obstacles([*meshes, *self.others], box[:3], box[3:], width)
        return self.clearance.with_obstacles(self._prepared[key].turn(frame.turn))


def plan_planar(body: Any, frame: Frame, around: Surroundings, process: Process) -> Plan:
    """Passes that build up a body, a Manifold relative to the frame's origin, layer by layer.

    All layers have one height, at most the process's, so that the last ends with the body. A layer is made where metal
    or the layer below is near enough. Passes, or pieces of passes, at which the nozzle comes too near to metal, other
    meshes or the layers below are left out.
    """
    process = replace(process, reach=turn_reach(process.reach, frame))
    local, metal = frame.move(body), frame.move(around.metal)
    deepest, high = local.bounding_box()[2], local.bounding_box()[5]
    low = find_foot(local, process.bead.width, process.height)
    count = max(1, int(np.ceil((high - low) / process.height - 1e-6)))
    height = (high - low) / count
    done = make_region([])
    passes: list[Pass] = []
    missing: list[Any] = []
    reasons: dict[str, float] = {}
    choice: _AxisChoice | None = None
    width = process.bead.width
    # below, where the layer before was too thin over metal for a bead, metal is that much lower
    under = max(height / 4, height - find_sink(height, process))
    rooted = process if process.sink is not None else replace(process, sink_share=ROOTED * process.sink_share)
    # of a large part little lies near, and of that the less the higher the layer
    standoff = around.clearance.standoff
    nearby = crop_metal(metal, local, 2 * height + low - deepest, measure_margin(standoff, process), standoff + height)
    above = local
    for number in range(count):
        floor, top = low + number * height, low + (number + 1) * height
        above, slab = above.split_by_plane(UP, top)
        wanted = cast_shadow(slab, process)
        foot = min(floor, deepest) if number == 0 else floor
        nearby = nearby.trim_by_plane(UP, foot - under)
        beside = nearby.trim_by_plane(DOWN, -top)
        ground = cast_shadow(beside, process)
        firm = shift_border(unite_regions([ground, done]), height * np.tan(process.overhang))
        held = wanted ^ firm
        aims = find_aims(nearby, beside, wanted, (floor, top), standoff, process)
        if number == 0 and shift_border(held ^ aims.drawn, -ROOM * width).is_empty():
            # a bead on the floor fills a root that is narrower than it, and melts into its sides
            aims = find_aims(nearby, beside, wanted, (floor, top), standoff, rooted)
        free = None if aims.free is None else aims.free ^ shift_border(held, OFF * width)
        angle = process.angle + number * process.turn
        drawn = held ^ aims.drawn
        style = process.choose_style(number, drawn, frame)
        lines = list_lines(drawn, process.pattern, process.bead, angle, free, process.shortest, firm, style)
        long = [line for line in lines if measure_length(line.points) >= process.shortest]
        short = cover([line.points for line in lines if measure_length(line.points) < process.shortest], width)
        made, dropped, shaded = list[Pass](), list[Floats](), list[Floats]()
        if long:
            # what the nozzle must not touch is gathered for the first line: trials of what is left may have none
            choice = choice or _AxisChoice(process, around.measure_from(body, frame, width))
            made, dropped, shaded = choice.place(long, top, number)
            made = order_passes(made, passes[-1] if passes else None, choice.clearance, process)
        done = cover([one.points[:, :2] for one in made], width)
        causes = [cover(dropped, width), cover(shaded, width), short if made else wanted]
        held -= _find_hanging(held, wanted, aims, process)
        gaps = (held ^ aims.reached) - done
        lost = _share_out(gaps, causes)
        narrow = _find_narrow(gaps - unite_regions(lost), free, firm, width)
        left = {
            UNSUPPORTED: wanted - held,
            SUNK: unite_regions([held - aims.flush, narrow]),
            SHADED: unite_regions([held ^ (aims.flush - aims.reached), lost[1]]),
            COLLIDES: lost[0],
            SHORT: lost[2],
        }
        for why, region in left.items():
            rest = region - done
            if rest.is_empty():
                continue
            is_whole = (wanted - rest).is_empty()
            piece = slab if is_whole else slab ^ rest.extrude(top - foot).translate((0, 0, foot))
            if piece.volume() > 0:
                missing.append(piece)
                reasons[why] = reasons.get(why, 0.0) + piece.volume()
        passes += made
        if sum(reasons.values()) > process.give_up:
            # what the layers above would fill is of no interest any more
            return Plan(frame, height, (), local, reasons)
    return Plan(frame, height, tuple(passes), _gather(missing), reasons)


def _find_hanging(held: Any, wanted: Any, aims: Aims, process: Process) -> Any:
    """What of the ``held`` region a bead could cover if all that is ``wanted`` were held, but for which its middle
    would have to stand on nothing: strips beside metal, narrower than half a bead."""
    if aims.free is None:
        return make_region([])
    reach = process.bead.width / 2
    return held ^ (shift_border(aims.free ^ wanted, reach) - shift_border(aims.free ^ held, reach))


def _find_narrow(region: Any, free: Any, firm: Any, width: float) -> Any:
    """The pieces of a region that no bead covers whose middle lies well in the regions ``free``, None for everywhere,
    and ``firm``: strips beside metal, where the middle would lie too far beside what is to be filled or what holds."""
    if free is None:
        return make_region([])
    off = WITHIN * width
    rest = region - shift_border(shift_border(free ^ firm, -off), width / 2 + off)
    return unite_regions([piece for piece in list_pieces(rest) if piece.area() > SLIVER * width**2])


def _share_out(gaps: Any, causes: Sequence[Any]) -> list[Any]:
    """The pieces of ``gaps``, a region, for each of the regions ``causes`` the ones that it is the first to meet."""
    found: list[list[Any]] = [[] for _ in causes]
    for piece in list_pieces(gaps):
        for own, cause in zip(found, causes, strict=True):
            if not (piece ^ cause).is_empty():
                own.append(piece)
                break
    return [unite_regions(own) for own in found]


def _gather(pieces: list[Any]) -> Any:
    from manifold3d import Manifold, OpType

    return Manifold.batch_boolean(pieces, OpType.Add) if pieces else None


def crop_metal(metal: Any, body: Any, under: float, beside: float, over: float) -> Any:
    """What lies of the metal in the box round the body that is larger by this much below, beside and above it."""
    from manifold3d import Manifold

    low = np.array(body.bounding_box()[:3]) - np.array([beside, beside, under])
    high = np.array(body.bounding_box()[3:]) + np.array([beside, beside, over])
    return metal ^ Manifold.cube(tuple(high - low)).translate(tuple(low))


class _AxisChoice:
    """Places the lines of a layer with tool axes."""

    def __init__(self, process: Process, clearance: Clearance) -> None:
        self.process, self.clearance = process, clearance
        tilt = process.tilt if process.axes == 5 else 0.0
        tilt = min(tilt, process.beam.incidence) if process.beam else tilt
        axes = list_axes(tilt, np.radians(30.0), 6) if process.is_trial else list_axes(tilt)
        if is_reached(axes[:1], process.reach).all():
            axes = axes[is_reached(axes, process.reach)]
        # everything up to the top of the layer stays below the nozzle's lowest point
        self.lowest = np.array([_find_lowest(clearance, axis) for axis in axes])
        self.axes = axes[self.lowest >= process.gap * (1 - 1e-9)]
        self.lowest = self.lowest[self.lowest >= process.gap * (1 - 1e-9)]

    def place(self, lines: Sequence[Line], top: float, layer: int) -> tuple[list[Pass], list[Floats], list[Floats]]:
        """Passes along the lines at a height; the pieces of lines (K,2) that the nozzle does not reach, and those that
        it reaches but its beam does not."""
        clearance, needed = self.clearance.above(top), self.process.gap
        made: list[Pass] = []
        dropped: list[Floats] = []
        if not len(self.axes):
            return made, [line.points for line in lines], dropped
        process = self.process
        least = int(np.ceil(process.shortest / process.step)) + 2
        limits = Limits(needed, process.step, process.turn_rate, least, not process.is_trial)
        sampled = []
        for line in lines:
            flat = extend_line(line.points, *process.extend)
            sampled.append(resample(np.column_stack([flat, np.full(len(flat), top)]), process.step))
        chosen = choose_axes([points for points, _ in sampled], self.axes, 0, clearance, limits)
        for (points, corner), pieces, line in zip(sampled, chosen, lines, strict=True):
            at = 0
            long = [each for each in pieces if measure_length(points[each.start : each.stop]) >= process.shortest]
            for piece in long:
                if piece.start > at:
                    dropped.append(points[at : piece.start])
                at = piece.stop
                made.append(self._make_pass(points, corner, piece, layer, line.kind))
            if at < len(points):
                dropped.append(points[at:])
        body = clearance.without_beam()
        shaded = [self._is_free(points, body) for points in dropped]
        flat_pieces = [points[:, :2] for points in dropped]
        return (
            made,
            [piece for piece, dark in zip(flat_pieces, shaded, strict=True) if not dark],
            [piece for piece, dark in zip(flat_pieces, shaded, strict=True) if dark],
        )

    def _is_free(self, points: Floats, body: Clearance) -> bool:
        """Whether the nozzle's body alone is free at most of the points (N,3), with an axis each."""
        count = len(self.axes)
        poses = np.repeat(points, count, axis=0), np.tile(self.axes, (len(points), 1))
        low, _ = body.bound(*poses, self.process.gap)
        return bool((low.reshape(-1, count).max(axis=1) >= self.process.gap).mean() > 0.5)

    def _make_pass(self, points: Floats, corner: Floats, piece: Piece, layer: int, kind: Kind) -> Pass:
        start, stop, axes, gaps = piece
        turns = np.zeros(stop - start, bool)
        turns[1:] = np.abs(np.diff(axes, axis=0)).max(axis=1) > 1e-9
        turns[:-1] |= turns[1:]
        chosen = np.flatnonzero((corner[start:stop] >= 0) | turns)
        chosen = np.unique(np.concatenate([[0], chosen, [stop - start - 1]]))
        if len(chosen) == 1:
            chosen = np.repeat(chosen, 2)
        tightest = int(np.argmin(gaps))
        lowest = min(_find_lowest(self.clearance, axis) for axis in np.unique(axes, axis=0))
        return Pass(
            points[start + chosen],
            axes[chosen],
            np.tile(Z, (len(chosen), 1)),
            layer,
            min(lowest, float(gaps.min()) - self.process.step / 2),
            (points[start + tightest], axes[tightest]),
            kind,
        )


def _find_lowest(clearance: Clearance, axis: Floats) -> float:
    """Height of the nozzle's lowest point above the point that it works on."""
    from damageest.geometry.transforms import turn_to_axis

    return float((clearance.nozzle.mesh.vertices @ turn_to_axis(axis).T)[:, 2].min() + clearance.standoff * axis[2])
