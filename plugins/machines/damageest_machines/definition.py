"""What a machine file says: axes, frames, home, process commands, and how the program is to be written.

Lengths in mm, angles in degrees, speeds in mm or degrees a second, whatever the unit of the job is.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from damageest.artefacts import Vector
from damageest.options import Options

Above = Annotated[float, Field(gt=0)]
Limits = tuple[float, float]
Pointing = Literal["x", "z", "-z"]


class Frame(Options):
    """A frame in another: ``position`` of its origin, and ``rotation`` about x, y, z of the other frame, in this order
    (Rz Ry Rx): c, b, a of KUKA, and w, p, r of Fanuc."""

    position: Vector = (0.0, 0.0, 0.0)
    rotation: Vector = Field(
        (0.0, 0.0, 0.0), description="turns about x, y, z of the other frame, in this order, in degrees"
    )


class Work(Frame):
    """Where the work offset lies: in the machine's frame, or the robot's base, with all rotary axes at 0."""

    name: str = Field("G54", description="work offset in the control's words, for example G54")
    number: int = Field(1, ge=0, description="number of a robot's base, work object or user frame")


class Tool(Frame):
    """The tip of the nozzle in the frame of the robot's flange, or of the machine's spindle nose."""

    number: int = Field(1, ge=0, description="number of the tool in the control")
    points: Pointing = Field(
        "z", description="which axis of the tool's frame points from the flange to the work; machine tools: -z"
    )
    spin: float = Field(0.0, description="turn of a robot's tool frame about that axis, in degrees")


class Frames(Options):
    """``part`` lies in ``work``; ``work`` in the machine's frame; ``tool`` on the flange."""

    work: Work = Work()
    part: Frame = Field(Frame(), description="frame of the path's files in that of the work offset")
    tool: Tool = Tool()


class Linear(Options):
    """A linear axis of a machine tool."""

    name: Literal["X", "Y", "Z"]
    limits: Limits
    speed: Above = 500.0
    acceleration: Above = 2000.0


class Rotary(Options):
    """A rotary axis: of a table or positioner, which carries the part, or of a head, which carries the tool."""

    name: str = Field(pattern="^[A-Z][0-9]?$", description="name in the control: A, B, C, or E1 of a positioner")
    carries: Literal["part", "tool"]
    direction: Vector = Field(
        description="direction of the axis in the machine's frame, with all axes at 0, by the right hand"
    )
    point: Vector = Field((0.0, 0.0, 0.0), description="a point on the axis, with all axes at 0")
    limits: Limits | None = Field(None, description="limits in degrees; none: the axis turns without end")
    speed: Above = 90.0
    acceleration: Above = 180.0


class Reach(Options):
    """A sphere about ``centre`` in the robot's base. The middle of the wrist, ``wrist`` back from the flange along its
    z, has to lie within ``most`` and beyond ``least``."""

    centre: Vector
    most: Above
    least: float = Field(0.0, ge=0)
    wrist: float = Field(0.0, ge=0)


class Robot(Options):
    """A robot. Its joints are left to its control, or to the hook damageest_kinematics."""

    reach: Reach
    speed: Above = Field(250.0, description="largest speed of the tool along its path")
    acceleration: Above = 1000.0
    turn: Above = Field(90.0, description="largest turning speed of the tool, in degrees a second")
    flat: Vector = Field(
        (0.0, 0.0, 1.0),
        description="with a positioner that follows: the tool axis, away from the work, in the robot's base",
    )
    follow: bool = Field(
        True, description="the positioner turns so that the tool axis is flat; false: it stays at home"
    )
    joints: str = Field("", description="name of the robot for the hook damageest_kinematics; empty: no joints")
    limits: tuple[Limits, ...] = Field((), description="limits of the joints that the hook gives")


class Command(Options):
    """Lines of the program, and the wait after them, in seconds."""

    lines: tuple[str, ...] = ()
    wait: float = Field(0.0, ge=0)


class Channel(Options):
    """The command of a channel of the process: ``line`` with {value}, which is ``scale`` times the path's value plus
    ``offset``, with so many ``decimals``. ``least`` and ``most`` limit the path's value."""

    line: str = Field(pattern=r"\{value\}")
    scale: float = 1.0
    offset: float = 0.0
    decimals: int = Field(3, ge=0, le=6)
    least: float = 0.0
    most: float = Field(description="largest value of the path that the process takes")


class Process(Options):
    """Commands that switch the deposition on and off, and set its channels."""

    on: Command
    off: Command
    channels: dict[str, Channel] = Field({}, description="channels, by their names in path.process")


class Post(Options):
    """The form of the program."""

    program: str = Field("SITE{site}", description="name of the program; {site} is the site's number")
    orientation: Literal["vectors", "axes"] = Field(
        "axes",
        description="5 axes: rotary angles, or the tool axis as a vector (Siemens A3 B3 C3, Heidenhain TX TY TZ)",
    )
    tcp: Literal["control", "table"] = Field(
        "control",
        description="control: the control keeps the tool's point, coordinates are the part's; table: coordinates turn "
        "with the table",
    )
    step: float = Field(
        2.0, gt=0, le=10, description="largest turn of the tool axis or of a rotary axis between two points"
    )
    blend: float = Field(0.05, ge=0, description="largest deviation of the control at the corners of a pass, in mm")
    head: tuple[str, ...] = Field((), description="further lines at the beginning, before the first move")
    foot: tuple[str, ...] = Field((), description="further lines at the end")
    configuration: str = Field(
        "", description="configuration of the arm in the robot's own words: S and T of KUKA, CONFIG of Fanuc"
    )


class Machine(Options):
    """A machine tool of 3 to 5 axes, or a robot, with or without a positioner."""

    name: str
    linear: tuple[Linear, ...] = Field((), description="X, Y and Z of a machine tool; none for a robot")
    rotary: tuple[Rotary, ...] = Field(
        (), max_length=2, description="rotary axes; of two that carry the same, the one nearer to the bed first"
    )
    robot: Robot | None = None
    frames: Frames = Frames()
    home: dict[str, float] = Field(
        {}, description="axes, by name, where the program begins and ends: X, Y, Z, A, C; A1 to A6, E1, E2 of a robot"
    )
    approach: float = Field(50.0, ge=0, description="distance along the tool axis of the approach to the first point")
    retract: float = Field(50.0, ge=0, description="distance along the tool axis of the retract from the last point")
    process: Process
    post: Post = Post()

    @model_validator(mode="after")
    def _check_axes(self) -> Machine:
        names = [axis.name for axis in self.linear]
        if self.robot is None and names != ["X", "Y", "Z"]:
            raise ValueError("a machine tool needs linear axes X, Y, Z, in this order; a robot needs robot")
        if self.robot is not None and names:
            raise ValueError("a robot has no linear axes; leave out linear, or robot")
        if self.robot is not None and any(axis.carries != "part" for axis in self.rotary):
            raise ValueError("the rotary axes beside a robot are those of its positioner: carries: part")
        twice = {axis.name for axis in self.rotary if [one.name for one in self.rotary].count(axis.name) > 1}
        if twice:
            raise ValueError(f"two rotary axes are called {', '.join(sorted(twice))}")
        axes: tuple[Linear | Rotary, ...] = (*self.linear, *self.rotary)
        for axis in axes:
            if axis.limits is not None and not axis.limits[0] < axis.limits[1]:
                raise ValueError(f"axis {axis.name}: the lower limit is not below the upper one")
            if axis.limits is not None and axis.name in self.home:
                low, high = axis.limits
                if not low <= self.home[axis.name] <= high:
                    raise ValueError(f"axis {axis.name}: home ({self.home[axis.name]:g}) is beyond its limits")
        directions = [np.array(axis.direction) for axis in self.rotary]
        if any(not np.linalg.norm(one) > 0 for one in directions):
            raise ValueError("the direction of a rotary axis needs a length above 0")
        if len(directions) == 2:
            a, b = (one / np.linalg.norm(one) for one in directions)
            if np.linalg.norm(np.cross(a, b)) < 0.1:
                raise ValueError("the rotary axes are parallel: they cannot tilt the tool to all sides")
        if self.robot is None and self.frames.tool.points != "-z":
            raise ValueError("frames.tool.points: the tool of a machine tool points along -z")
        return self

    @property
    def follows(self) -> bool:
        """Whether the rotary axes are chosen for the tool axis: those of a machine tool, and of a positioner that
        follows."""
        return bool(self.rotary) and (self.robot is None or self.robot.follow)
