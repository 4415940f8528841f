"""Passes layer by layer, checked against collision of the nozzle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field, model_validator

from damageest.artefacts import DepositPath, Floats, Mesh, Solid, Vector
from damageest.errors import StageError
from damageest.options import Options
from damageest.stages import JobPath
from damageest.stages.path import Path
from damageest_paths.process.calibration import Trials, check_reach, complete_size, relax_size
from damageest_paths.process.channels import SPEED, ProcessTable, list_channels
from damageest_paths.tool.mesh_files import find_mesh_fault, read_mesh_file

Length = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Angle = Annotated[float, Field(allow_inf_nan=False)]


class StartPlace(Options):
    """Near to which rings begin."""

    at: Vector = Field(description="[x, y, z] in part coordinates")


def _check_direction(value: Literal["auto", "normal"] | Vector) -> Literal["auto", "normal"] | Vector:
    if not isinstance(value, str) and not np.linalg.norm(value) > 0:
        raise ValueError("a direction needs a length above 0")
    return value


class BeamShape(Options):
    """The beam from the nozzle's tip to the bead: light, powder, wire or arc."""

    radius: Length | None = Field(
        None, description="radius at the bead, in the job's unit; default: half the bead's width"
    )
    cone: float = Field(0.0, ge=0, lt=60, description="half the opening angle towards the tip, in degrees")


class Nozzle(Options):
    """A nozzle that is a solid of revolution, or a closed mesh with its tip at 0 and its axis along z."""

    tip_radius: float | None = Field(
        None, ge=0, allow_inf_nan=False, description="radius of the flat tip, in the job's unit"
    )
    cone_angle: float = Field(
        30.0, ge=0, lt=85, description="angle between the axis and the side of the cone, in degrees"
    )
    length: Length | None = Field(None, description="length of the whole nozzle from the tip, in the job's unit")
    body_radius: Length | None = Field(None, description="radius of the cylinder above the cone, in the job's unit")
    mesh: JobPath | None = Field(None, description="file of a closed mesh, in the job's unit, instead of the others")
    beam: BeamShape = Field(
        BeamShape(),
        description="{radius, cone}: what has to be free between tip and bead; radius at the bead, default half its "
        "width; cone: half the angle by which it widens towards the tip, in degrees",
    )

    @model_validator(mode="after")
    def _check_shape(self) -> Nozzle:
        given = [self.tip_radius, self.length, self.body_radius]
        if self.mesh is not None and any(value is not None for value in given):
            raise ValueError("give mesh, or tip_radius, length and body_radius; not both")
        if self.mesh is None and any(value is None for value in given):
            raise ValueError("give tip_radius, length and body_radius, or mesh")
        if self.mesh is None and (self.body_radius or 0) < (self.tip_radius or 0):
            raise ValueError("body_radius must not be smaller than tip_radius")
        return self


class Machine(Options):
    """Limits of the machine."""

    tilt: float = Field(
        60.0, ge=0, lt=90, description="largest angle between tool axis and build direction, in degrees"
    )
    turn: float = Field(
        20.0,
        ge=0,
        allow_inf_nan=False,
        description="largest turn of the tool axis along a pass with 5 axes, in degrees per bead width; 0: none",
    )


class Layers(Path):
    """Passes layer by layer along a build direction, for a nozzle that lays beads of metal or plastic.

    All lengths are in the job's unit, all places in part coordinates. Beads are blocks; heat, flow and shrinkage are
    not considered.
    """

    use: Literal["layers"] = "layers"
    height: Length = Field(
        description="largest height of a layer; layers are made equal, so that the last ends at the top"
    )
    layers: Literal["auto", "planar", "conformal"] = Field(
        "auto",
        description="planar: planes across the build direction; conformal: surfaces at equal height above the floor "
        "of the cavity, up to 75 degrees steep; auto: conformal where planes lose more than 7 % of the deposit and it "
        "loses at most half of that, or where a thin shell needs five times as many planes and these cost much more; "
        "else planar",
    )
    width: Length = Field(description="width of a bead; optional with calibration, like height")
    feed: Length = Field(description="speed of deposition, in lengths a minute; less where a bead is higher")
    nozzle: Nozzle = Field(
        description="{tip_radius, cone_angle, length, body_radius}: a flat tip, a cone of this angle (degrees) between "
        "axis and side, a cylinder; or {mesh: path}, tip at 0, axis along z"
    )
    overlap: float = Field(0.3, ge=0, lt=0.9, description="share of a bead's width that the next bead overlaps")
    axes: Literal[3, "3+2", 5] = Field(
        3,
        description="3: one direction for the whole deposit, tool along it; 3+2: cut into parts with a direction each; "
        "5: the tool is tilted too, pass by pass, where it would collide",
    )
    direction: Annotated[Literal["auto", "normal"] | Vector, AfterValidator(_check_direction)] = Field(
        "auto",
        description="build direction: [x, y, z]; normal: the mean normal of the deposit's open side; auto: that where "
        "it reaches all, else the one that reaches most of it, the normals of open planes, and the axes",
    )
    pattern: Literal["zigzag", "contour", "spiral", "offset-zigzag"] = Field(
        "zigzag",
        description="zigzag: rows to and fro; contour: rings; spiral: rings linked into one pass; offset-zigzag: one "
        "ring, rows inside",
    )
    angle: Literal["auto"] | Angle = Field(
        "auto",
        description="direction of the rows in the first layer, in degrees; auto: 0, but along a long narrow "
        "region, in every layer",
    )
    turn: float = Field(90.0, allow_inf_nan=False, description="turn of the rows from layer to layer, in degrees")
    starts: Literal["spread", "aligned"] | StartPlace = Field(
        "spread",
        description="starts of rings: spread: in another direction from layer to layer; aligned; {at: [x, y, z]}",
    )
    overhang: float = Field(
        45.0, ge=0, lt=90, description="largest angle between build direction and an overhanging side, in degrees"
    )
    min_length: float | None = Field(
        None,
        ge=0,
        allow_inf_nan=False,
        description="shorter passes are lengthened where there is room, else left out; default: half the bead's width",
    )
    incidence: float = Field(
        60.0, gt=0, lt=90, description="largest angle between the tool and the normal of the layer, in degrees"
    )
    penetration: float | None = Field(
        None,
        ge=0,
        allow_inf_nan=False,
        description="depth to which a bead may lie in intact metal, which melts; default: 0.45 of a layer's height, or "
        "0.4 or 0.3 where more than 5 % of the deposit would lie in it",
    )
    standoff: Length | None = Field(
        None, description="distance from the nozzle's tip to the top of the bead; default: the bead's width"
    )
    clearance: Length | None = Field(
        None, description="distance that the nozzle keeps from everything; default: a quarter of the bead's width"
    )
    machine: Machine = Field(Machine(), description="{tilt: largest angle of the tool against the build direction}")
    fixture: JobPath | None = Field(
        None, description="file of a mesh that the nozzle must not touch, in part coordinates"
    )
    travel_feed: Length | None = Field(None, description="speed between passes; default: five times feed")
    travel_clearance: Length | None = Field(
        None,
        description="lift between passes, along the tool; default: none where the way is free without, else two widths "
        "of a bead",
    )
    start_overlap: float = Field(0.0, ge=0, allow_inf_nan=False, description="lead of a pass before its start")
    stop_overlap: float = Field(0.0, ge=0, allow_inf_nan=False, description="overrun of a pass beyond its end")
    sites: tuple[int, ...] = Field((), description="numbers of the sites that are built up first, in this order")
    process: ProcessTable = Field(
        (),
        description="table of the process: rows {layer, kind, first, radius, thickness, rest, set: {power: .., powder: "
        ".., speed: ..}}; of rows that hold for a place, the last counts",
    )
    interpass: float = Field(
        0.0,
        ge=0,
        description="least seconds between a bead and the next one beside or on it of another pass: the tool waits",
    )
    calibration: Trials = Field(
        (),
        description="rows {set: {speed: .., power: ..}, width, height}: measured beads of trials; they give width "
        "and height of the planned beads, which the path's files list",
    )
    simulate: bool = Field(True, description="compare the union of the beads with the deposit, on voxels")

    model_config = ConfigDict(json_schema_extra=relax_size)

    @model_validator(mode="before")
    @classmethod
    def _complete_size(cls, values: Any) -> Any:
        return complete_size(values)

    @model_validator(mode="after")
    def _check_calibration(self) -> Layers:
        if self.calibration:
            values: dict[str, list[float]] = {SPEED: [self.feed]}
            for row in self.process:
                for name, value in row.set.items():
                    values.setdefault(name, []).append(value)
            check_reach(self.calibration, {name: np.array(each) for name, each in values.items()})
        return self

    @model_validator(mode="after")
    def _check_standoff(self) -> Layers:
        if self.standoff is not None and self.standoff < self._gap:
            words = f"standoff ({self.standoff:g}) is smaller than clearance ({self._gap:g})"
            raise ValueError(f"{words}: the tip would be too near to the bead that it lays")
        return self

    @property
    def _gap(self) -> float:
        return self.clearance or self.width / 4

    def list_channels(self) -> tuple[str, ...]:
        """Those that the table of the process sets, but for the speed, which is the feed."""
        return list_channels(self.process)

    def find_faults(self, job: Mapping[str, Any], registry: Any) -> list[tuple[tuple[str | int, ...], str]]:
        """A nozzle or a fixture whose mesh cannot be used."""
        return [*find_mesh_fault(self.nozzle.mesh, "nozzle", "mesh"), *find_mesh_fault(self.fixture, "fixture")]

    def rank_site(self, number: int) -> int:
        """Sites named in ``sites`` come first, in that order."""
        return self.sites.index(number) if number in self.sites else len(self.sites)

    def run(
        self, body: Solid, left: Solid | None, built: Solid | None, tolerance: float, reach: Floats | None = None
    ) -> DepositPath | None:
        """The path. Raises StageError where the nozzle, the fixture or the direction cannot be used."""
        from damageest_paths.assemble import Speeds, describe_surplus, plan_moves
        from damageest_paths.drafts import Draft, Task, draft_path
        from damageest_paths.fill.stripes import Bead
        from damageest_paths.foot import raise_beads
        from damageest_paths.form_choice import is_thin_shell, plan_in_form
        from damageest_paths.laid import simulate_laid
        from damageest_paths.layering.directions import Planner, find_open_normal
        from damageest_paths.process.process import Cooling, Process
        from damageest_paths.process.settings import add_sizes, apply_table
        from damageest_paths.tool.sight import Beam

        fast = self.travel_feed or 5 * self.feed
        process = Process(
            height=self.height,
            bead=Bead(self.width, (1 - self.overlap) * self.width),
            pattern=self.pattern,
            angle=0.0 if self.angle == "auto" else float(np.radians(self.angle)),
            turn=float(np.radians(self.turn)),
            overhang=float(np.radians(self.overhang)),
            shortest=self.width / 2 if self.min_length is None else self.min_length,
            gap=self._gap,
            axes=self.axes,
            tilt=float(np.radians(self.machine.tilt)),
            extend=(self.start_overlap, self.stop_overlap),
            turn_rate=float(np.radians(self.machine.turn)) / self.width,
            beam=Beam(
                self.nozzle.beam.radius or self.width / 2,
                float(np.radians(self.nozzle.beam.cone)),
                float(np.radians(self.incidence)),
            ),
            sink=self.penetration,
            cooling=Cooling(self.interpass, self.feed, fast) if self.interpass else None,
            is_along=self.angle == "auto",
            starts=np.array(self.starts.at) if isinstance(self.starts, StartPlace) else self.starts,
            reach=reach if self.axes == 5 else None,
        )
        direction: Floats | None = None
        if self.direction == "normal":
            direction = find_open_normal(body, left, tolerance)
        elif not isinstance(self.direction, str):
            direction = np.array(self.direction) / np.linalg.norm(self.direction)
        others: list[Mesh] = [built] if built is not None else []
        if self.fixture is not None:
            others.append(read_mesh_file(self.fixture, "fixture"))
        task, nozzle = Task(body, left, others, tolerance), self._make_nozzle()
        speeds = Speeds(self.feed, fast, self.travel_clearance)

        def plan(planner: Planner, along_normal: bool = False) -> Draft:
            chosen = find_open_normal(body, left, tolerance) if along_normal and direction is None else direction
            return draft_path(task, nozzle, self.standoff or self.width, process, self.simulate, chosen, planner)

        is_shell = self.layers == "auto" and is_thin_shell(body, self.height)
        draft = plan_in_form(self.layers, plan, is_shell, self.penetration is not None)
        if self.layers == "conformal" and draft.is_empty:
            why = "; ".join(item.why for item in draft.unreached)
            raise StageError(f"no pass of a conformal layer can be laid: {why}", "layers: planar, or another direction")
        moves = plan_moves(draft, speeds)
        if not self.calibration:
            return describe_surplus(apply_table(raise_beads(moves, left), self.process, self.interpass, body, left))
        path = add_sizes(apply_table(moves, self.process, self.interpass, body, left), self.calibration)
        return describe_surplus(simulate_laid(path, draft))

    def _make_nozzle(self) -> Any:
        from damageest_paths.tool import nozzle

        shape = self.nozzle
        if shape.mesh is not None:
            return nozzle.Nozzle(read_mesh_file(shape.mesh, "nozzle"))
        assert shape.tip_radius is not None
        assert shape.body_radius is not None
        assert shape.length is not None
        angle = float(np.radians(shape.cone_angle))
        return nozzle.make_nozzle(nozzle.Cone(shape.tip_radius, shape.body_radius, shape.length, angle))
