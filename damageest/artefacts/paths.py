"""Paths that build up a deposit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np

from damageest.artefacts.arrays import Flags, Floats, Ints
from damageest.artefacts.fields import ArtefactError, Checked, NotNegative, Shape, Span, require_shape
from damageest.artefacts.meshes import Mesh, Solid

_OPEN = Span(high=np.inf)


@dataclass(frozen=True)
class Unreached(Checked):
    """Deposit that no pass fills: its ``volume`` and ``why``."""

    volume: NotNegative
    why: str


@dataclass(frozen=True)
class BeadFill(Checked):
    """The union of a path's beads against the deposit, on voxels. ``air`` and ``air_95``: 0 where no bead lies on
    metal."""

    voxel: Annotated[float, "edge of the voxels"]
    filled: Annotated[float, "share of the reachable deposit that beads fill"]
    gap: Annotated[float, "volume of the reachable deposit without beads"]
    void: Annotated[float, "diameter of the largest ball in it"]
    largest_gap: Annotated[float, "volume of its largest connected piece"]
    spill: Annotated[float, "volume of beads outside the deposit and the metal"]
    spill_distance: Annotated[float, "largest distance of beads from deposit and metal"]
    sunk: Annotated[float, "volume of beads where metal is already"]
    of_deposit: Annotated[
        float,
        "share of the whole deposit that beads fill: 1 without the shares of `unreachable_volume` and "
        "`gap`, as far as the voxels resolve it",
    ]
    air: Annotated[float, "height of the air between metal and the beads that lie on it, median"] = 0.0
    air_95: Annotated[float, "the height that 95 % of their length does not exceed"] = 0.0


@dataclass(frozen=True, eq=False)
class DepositPath(Checked):
    """Moves of the tool that build up one site's deposit, in the part's frame.

    ``points`` (N,3): where the tool works, on the top of the bead. ``axes`` (N,3): the tool axis, a unit vector away
    from the work; the nozzle's tip is ``standoff`` along it from the point. ``normals`` (N,3): the normal of the layer.
    ``feed`` (N,): speed of the move that ends there, in lengths a minute; ``on`` (N,): whether it deposits. ``layer``,
    ``number``, ``part`` (N,): of layer, pass and part of the deposit, from 1. ``directions`` (P,3): the build direction
    of each part; ``heights`` (P,): of its layers. ``width`` of a bead; ``section``: area of its section, that of what
    it adds. ``nozzle``: its mesh, tip at 0, axis along z. ``clearance``, ``travel_clearance``: inf without obstacles.
    ``tightest`` (2,3): point and axis of the least. ``missing``: what is ``unreached``, as a solid. ``notes`` are
    warnings. ``kinds``: what each pass is, by its number: row, ring, spiral, rim, or gap (between others); empty where
    not known. ``setup`` (4,4). ``channels``: names of what the process is given besides the speed, as power or powder,
    and ``values`` (N,C): of each on the move that ends there, in the unit that the job has; None without channels.
    ``around`` (4,): centre and radius of a ball that holds all that the tool must not touch; ``free_ends`` (K,):
    whether the tool can leave it straight along its axis from the end of each pass. Both None where not known, the
    second also where the tool axis is the same everywhere. ``dwell`` (N,): seconds that the tool stands at each point,
    with the process off; None: nowhere. ``bead_sizes`` (N,2): width and height of the bead of the move that ends there,
    as its settings make it; None: ``width`` and ``heights``, with which the path was planned.
    """

    points: Annotated[Floats, Shape("N", 3)]
    axes: Annotated[Floats, Shape("N", 3)]
    normals: Annotated[Floats, Shape("N", 3)]
    feed: Annotated[Floats, Shape("N")]
    on: Annotated[Flags, Shape("N")]
    layer: Annotated[Ints, Shape("N")]
    number: Annotated[Ints, Shape("N")]
    part: Annotated[Ints, Shape("N")]
    directions: Annotated[Floats, Shape("P", 3)]
    heights: Annotated[Floats, Shape("P")]
    width: NotNegative
    section: Annotated[Floats, Shape("P")]
    standoff: NotNegative
    deposit_volume: NotNegative
    nozzle: Mesh
    clearance: Annotated[
        float,
        _OPEN,
        "distance that the nozzle keeps at least from metal, earlier deposits, fixture and layers below "
        "during deposition; what is farther than the job asks for is not measured; null: none is near",
    ]
    travel_clearance: Annotated[float, _OPEN, "the same between passes"]
    tightest: Annotated[Floats | None, Shape(2, 3, finite=False)] = None
    unreached: Annotated[tuple[Unreached, ...], "that volume by reason"] = ()
    missing: Solid | None = None
    fill: Annotated[BeadFill | None, "null where it was not simulated"] = None
    notes: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    setup: Annotated[
        Floats | None,
        Shape(4, 4),
        "with 3 axes: transform (4 rows) of a point of the part's frame to the frame in which the part is "
        "set up, z along the tool; the path's files are in that frame. Null: they are in the part's frame",
    ] = None
    channels: tuple[str, ...] = ()
    values: Annotated[Floats | None, Shape("N", "C")] = None
    layer_form: Annotated[
        str,
        "planar: planes across the build direction; conformal: surfaces along the floor of the cavity; "
        "empty: not known",
    ] = ""
    around: Annotated[Floats | None, Shape(4)] = None
    free_ends: Flags | None = None
    dwell: Annotated[Floats | None, Shape("N")] = None
    bead_sizes: Annotated[Floats | None, Shape("N", 2)] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        count = len(self.points)
        if (self.values is None) == bool(self.channels):
            raise ArtefactError("channels, values: one without the other")
        if self.values is not None:
            require_shape("values", self.values, count, len(self.channels))
        for name in ("dwell", "bead_sizes"):
            if count and (own := getattr(self, name)) is not None and own.min() < 0:
                raise ArtefactError(f"{name}: not all 0 or more")
        with np.errstate(over="ignore"):
            is_unit = np.allclose(np.linalg.norm(self.axes, axis=1), 1, atol=1e-6)
        if not is_unit:
            raise ArtefactError("axes: not all have the length 1")
        if count and not (self.feed > 0).all():
            raise ArtefactError("feed: not all above 0")
        if count and min(self.layer.min(), self.number.min(), self.part.min()) < 1:
            raise ArtefactError("layer, number, part: expected numbers from 1 up")
        if count and self.part.max() > len(self.directions):
            raise ArtefactError(f"part: number {self.part.max()} of the {len(self.directions)} parts")
        if self.free_ends is not None:
            require_shape("free_ends", self.free_ends, self.passes)
        if self.kinds and len(self.kinds) != self.passes:
            raise ArtefactError(f"kinds: {len(self.kinds)} for {self.passes} passes")
        if count and self.on[0]:
            raise ArtefactError("on: the first move has no start, so it cannot deposit")

    @cached_property
    def moves(self) -> Floats:
        """(N,) length of the move that ends at each point; 0 for the first."""
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        return np.concatenate([[0.0], steps]) if len(self.points) else np.empty(0)

    @property
    def reach(self) -> float:
        """Largest distance of a point of the nozzle from the point that it works on."""
        tool = self.nozzle.vertices + np.array([0.0, 0.0, self.standoff])
        return float(np.linalg.norm(tool, axis=1).max(initial=self.standoff))

    @property
    def length(self) -> float:
        """Length of all passes."""
        return float(self.moves[self.on].sum())

    @property
    def travel(self) -> float:
        """Length of the moves between them."""
        return float(self.moves[~self.on].sum())

    @property
    def minutes(self) -> float:
        """Time of all moves at their feeds, without acceleration, and of all waits."""
        return float((self.moves / self.feed).sum()) + self.wait_minutes if len(self.points) else 0.0

    @property
    def wait_minutes(self) -> float:
        """Minutes of these in which the tool waits for neighbouring beads to cool down."""
        return float(self.waits.sum()) / 60

    @property
    def waits(self) -> Floats:
        """Seconds (N,) that the tool stands at each point."""
        return np.zeros(len(self.points)) if self.dwell is None else self.dwell

    @property
    def sizes(self) -> Floats:
        """Width and height (N,2) of the bead of each move."""
        return self.planned_sizes if self.bead_sizes is None else self.bead_sizes

    @property
    def planned_sizes(self) -> Floats:
        """Width and height (N,2) with which the bead of each move was planned."""
        heights = self.heights[self.part - 1]
        return np.column_stack([np.full(len(heights), self.width), heights])

    @property
    def passes(self) -> int:
        return int(self.number[-1]) if len(self.points) else 0

    @property
    def layers(self) -> int:
        """Number of layers, summed over the parts of the deposit."""
        return len(np.unique(np.stack([self.part, self.layer]), axis=1).T) if len(self.points) else 0

    @property
    def bead_volume(self) -> float:
        """Volume that the passes add: length by section, that of the beads as laid."""
        if not len(self.points):
            return 0.0
        added = self.moves * self.section[self.part - 1]
        if self.bead_sizes is not None:
            added = added * self.bead_sizes.prod(axis=1) / self.planned_sizes.prod(axis=1)
        return float(added[self.on].sum())

    @property
    def surplus_volume(self) -> float:
        """Volume that the passes add beyond the reached deposit.

        It is 0 where they add less."""
        return max(self.bead_volume - (self.deposit_volume - self.unreached_volume), 0.0)

    @property
    def unreached_volume(self) -> float:
        """Volume of the deposit that no pass fills."""
        return sum(item.volume for item in self.unreached)
