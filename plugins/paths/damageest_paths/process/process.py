"""What a path is planned with, and what a plan consists of."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from damageest.artefacts import Floats
from damageest_paths.fill.lines import Kind
from damageest_paths.fill.stripes import Bead
from damageest_paths.fill.weave import Pattern, Style
from damageest_paths.process.frames import Frame
from damageest_paths.tool.sight import Beam

Axes = Literal[3, "3+2", 5]
GOLDEN = np.pi * (3 - np.sqrt(5.0))
"""Turn of the direction in which rings start, from layer to layer: it comes near to no earlier one for long."""


@dataclass(frozen=True)
class Cooling:
    """The least ``seconds`` between laying neighbouring beads of two passes; ``feed`` and ``fast``: speeds of
    deposition and of travel, in lengths a minute."""

    seconds: float
    feed: float
    fast: float


@dataclass(frozen=True)
class Process:
    """Lengths in the job's unit, angles in radians.

    ``height``: largest of a layer. ``turn``: of the rows from layer to layer. ``overhang``: largest angle between the
    build direction and an overhanging side. ``shortest``: least length of a pass. ``gap``: distance that the nozzle has
    to keep. ``tilt``: largest of the tool axis against the build direction. ``extend``: how far a pass begins before
    its start and goes on beyond its end. ``turn_rate``: largest turn of the tool axis per length along a pass.
    ``is_trial``: few axes are tried. ``give_up``: the volume from which on a trial need not go on if it misses more.
    ``beam``: see `Beam`. ``sink``: how deep a bead may lie in intact metal; None: the share ``sink_share`` of the
    height of a layer. ``cooling``: see `Cooling`; None: beads need not cool down. ``is_along``: long regions have their
    rows along them. ``starts``: of rings, in directions that differ from layer to layer, or do not, or near to a point
    (3,) of the part. ``reach``: of the machine, see the stage `path`, in the part's frame, or in a plan's.
    """

    height: float
    bead: Bead
    pattern: Pattern
    angle: float
    turn: float
    overhang: float
    shortest: float
    gap: float
    axes: Axes
    tilt: float
    extend: tuple[float, float] = (0.0, 0.0)
    turn_rate: float = 0.0
    is_trial: bool = False
    give_up: float = np.inf
    beam: Beam | None = None
    sink: float | None = None
    sink_share: float = 0.45
    cooling: Cooling | None = None
    is_along: bool = True
    starts: Literal["spread", "aligned"] | Floats = "spread"
    reach: Floats | None = None

    def choose_style(self, layer: int, region: Any = None, frame: Frame | None = None) -> Style:
        """How rows and rings of a layer run in a region of a plane across the frame's z; without these, a place near to
        which rings begin has no direction, and they begin alike."""
        if isinstance(self.starts, str) or frame is None:
            return Style(
                self.is_along, layer * GOLDEN if isinstance(self.starts, str) and self.starts == "spread" else 0.0
            )
        left, low, right, high = region.bounds()
        x, y, _ = frame.to_local(self.starts)
        return Style(self.is_along, float(np.arctan2(y - (low + high) / 2, x - (left + right) / 2)))

    @property
    def step(self) -> float:
        """Distance of the poses at which the nozzle is checked: it comes nearer by half of it between two at most."""
        return min(self.bead.width / 2, self.gap)

    def coarsen(self, factor: float) -> Process:
        """The same with larger layers and beads, for a quick trial."""
        bead = Bead(factor * self.bead.width, factor * self.bead.step)
        beam = None if self.beam is None else replace(self.beam, radius=factor * self.beam.radius)
        return replace(
            self, height=factor * self.height, bead=bead, pattern="zigzag", extend=(0.0, 0.0), is_trial=True,
            shortest=factor * self.shortest, beam=beam, sink=None if self.sink is None else factor * self.sink,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Pass:
    """One pass: ``points`` (K,3) on the top of the bead, ``axes`` (K,3) from the tip away from the work, ``normals``
    (K,3) of the layer, ``gap``: least distance of the nozzle, ``tightest``: the point (3,) and axis (3,) there,
    ``kind``: see `fill.Kind`."""

    points: Floats
    axes: Floats
    normals: Floats
    layer: int
    gap: float = np.inf
    tightest: tuple[Floats, Floats] | None = None
    kind: Kind = "row"

    def reverse(self) -> Pass:
        """The same pass, run the other way."""
        return replace(self, points=self.points[::-1], axes=self.axes[::-1], normals=self.normals[::-1])


@dataclass(frozen=True, eq=False)
class Plan:
    """Passes for one build direction, in the order of their layers, in coordinates relative to the frame's origin.

    ``height``: of a layer. ``missing``: a Manifold of what they do not fill, or None; ``reasons``: volume by reason.
    """

    frame: Frame
    height: float
    passes: tuple[Pass, ...]
    missing: Any
    reasons: dict[str, float] = field(default_factory=dict)

    @property
    def missing_volume(self) -> float:
        return float(self.missing.volume()) if self.missing is not None else 0.0


def measure_along(points: Floats) -> Floats:
    """The way (N,) along a polyline to each of its points (N,K)."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def extend_line(line: Floats, before: float, after: float) -> Floats:
    """A line that begins earlier and ends later; a closed one overlaps its own start."""
    if not before and not after:
        return line
    if np.allclose(line[0], line[-1]):
        at = measure_along(line)
        stop = min(before + after, at[-1] / 2)
        end = np.array([np.interp(stop, at, line[:, k]) for k in range(2)])
        return np.concatenate([line, line[1:][at[1:] < stop], end[None]])
    first, last = line[0] - line[1], line[-1] - line[-2]
    start = line[0] + before * first / max(float(np.linalg.norm(first)), 1e-300)
    end = line[-1] + after * last / max(float(np.linalg.norm(last)), 1e-300)
    return np.concatenate([start[None], line[1:-1], end[None]])
