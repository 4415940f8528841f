"""Where the axes of a machine stand at each move, and whether it can stand there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Floats
from damageest.errors import StageError
from damageest_machines.definition import Machine
from damageest_machines.frames import OPPOSITE, make_tool_frame, make_transform, point_along, turn_between
from damageest_machines.moves import Moves
from damageest_machines.rotary import turn_rotary

WRIST = 40.0
"""Degrees by which a joint may turn between two points at most; more is a turn of the wrist from one form of the arm to
another."""


@dataclass(frozen=True, eq=False)
class Positions:
    """``rotary`` (M,K): angles of the rotary axes in degrees. ``linear`` (M,3): X, Y, Z of a machine tool in its own
    frame, or the tool's point in a robot's base. ``frames`` (M,3,3): the tool's frame in that of the work offset,
    ``still`` (M,3,3): the same where that does not turn with the positioner; None for a machine tool. ``joints`` (M,J):
    of a robot, in degrees, None where they are not known. ``tool`` and ``base`` (4,4): frame of the tool's point on the
    flange, and of the work offset. ``turned`` (M,3): the points in the frame of the work offset when it does not turn
    with the table. ``notes``: what the user is told."""

    rotary: Floats
    linear: Floats
    frames: Floats | None
    still: Floats | None
    joints: Floats | None
    tool: Floats
    base: Floats
    turned: Floats
    notes: tuple[str, ...]


def find_positions(machine: Machine, moves: Moves, standoff: float, rotary: Floats) -> Positions:
    """``standoff`` in mm; ``rotary`` (M,K): angles of the rotary axes. Raises StageError for what the machine cannot
    do: an axis beyond its limits, a pose that it does not reach, a joint that would have to jump."""
    base = make_transform(machine.frames.work)
    tool = make_transform(machine.frames.tool)
    tool[:3, 3] += standoff * tool[:3, :3] @ point_along(machine.frames.tool.points)
    notes: list[str] = []
    R, s = turn_rotary(machine.rotary, rotary, "part")
    world = np.einsum("nij,nj->ni", R, moves.points @ base[:3, :3].T + base[:3, 3]) + s
    turned = (world - base[:3, 3]) @ base[:3, :3]
    if machine.robot is None:
        H, shift = turn_rotary(machine.rotary, rotary, "tool")
        linear = world - (H @ tool[:3, 3] + shift)
        _check_linear(machine, moves, linear)
        return Positions(rotary, linear, None, None, None, tool, base, turned, tuple(notes))
    turns, joints = _place_robot(machine, moves, base, tool, rotary, R, world, notes)
    frames, still = np.swapaxes(R @ base[:3, :3], 1, 2) @ turns, base[:3, :3].T @ turns
    return Positions(rotary, world, frames, still, joints, tool, base, turned, tuple(notes))


def _check_linear(machine: Machine, moves: Moves, linear: Floats) -> None:
    for number, axis in enumerate(machine.linear):
        low, high = axis.limits
        beyond = np.maximum(low - linear[:, number], linear[:, number] - high)
        if beyond.max() > 1e-9:
            k = int(beyond.argmax())
            raise StageError(
                f"{axis.name} would be at {linear[k, number]:.2f}, beyond its limits of {low:g} to {high:g}, on "
                f"{int((beyond > 0).sum())} of {len(linear)} moves: {moves.describe(k)}",
                "another frames.work or frames.tool in the machine file, shorter approach or retract, less tilt",
            )


def _place_robot(
    machine: Machine,
    moves: Moves,
    base: Floats,
    tool: Floats,
    rotary: Floats,
    R: Floats,
    world: Floats,
    notes: list[str],
) -> tuple[Floats, Floats | None]:
    """The tool's frames (M,3,3) in the robot's base, and the joints (M,J)."""
    robot = machine.robot
    assert robot is not None
    axes = np.einsum("nij,nj->ni", R, moves.axes @ base[:3, :3].T)
    flat = np.array(robot.flat) / np.linalg.norm(robot.flat)
    cosine = axes @ flat
    if cosine.min() < OPPOSITE:
        k = int(cosine.argmin())
        raise StageError(
            f"the tool would point against robot.flat, so its frame is not defined: {moves.describe(k)}",
            "another path.direction, another frames.work, or robot.flat in the machine file",
        )
    own = make_tool_frame(flat, machine.frames.tool.points, machine.frames.tool.spin)
    turns = turn_between(flat, axes) @ own
    poses = np.tile(np.eye(4), (len(world), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = turns, world
    poses = poses @ np.linalg.inv(tool)
    _check_reach(machine, moves, poses)
    joints = _find_joints(machine, moves, poses, rotary)
    if joints is None:
        notes.append(
            "the wrist stays within the robot's reach; its joints were not checked: their limits and singularities are "
            "left to the control. Run the program in its simulation first"
        )
    return turns, joints


def _check_reach(machine: Machine, moves: Moves, poses: Floats) -> None:
    assert machine.robot is not None
    reach = machine.robot.reach
    far = np.linalg.norm(poses[:, :3, 3] - reach.wrist * poses[:, :3, 2] - reach.centre, axis=1)
    for wrong, k in ((far > reach.most, int(far.argmax())), (far < reach.least, int(far.argmin()))):
        if wrong.any():
            raise StageError(
                f"{wrong.sum()} of {len(far)} poses are out of the reach of {machine.name}: the wrist would be "
                f"{far[k]:.0f} from robot.reach.centre, and {reach.least:g} to {reach.most:g} is permitted: "
                f"{moves.describe(k)}",
                "another frames.work or frames.tool in the machine file, or shorter approach or retract",
            )


def check_kinematics(machine: Machine) -> None:
    """Raises StageError where the machine has joints and no plugin knows them. A pose, the base's own frame, is asked
    for to learn that; whether it can be taken does not matter."""
    if machine.robot is None or not machine.robot.joints:
        return
    from damageest import Registry

    turns = np.zeros((1, len(machine.rotary)))
    if Registry.discover().find_joints(machine.robot.joints, np.eye(4)[None], turns) is None:
        raise _refuse_joints(machine.robot.joints)


def _refuse_joints(name: str) -> StageError:
    return StageError(
        f"no plugin gives joints for '{name}' by the hook damageest_kinematics",
        "install the plugin, or leave robot.joints out of the machine file",
    )


def _find_joints(machine: Machine, moves: Moves, poses: Floats, rotary: Floats) -> Floats | None:
    """What the hook damageest_kinematics gives. Raises StageError where a pose has no joints, one is beyond its limits
    or jumps."""
    robot = machine.robot
    assert robot is not None
    if not robot.joints:
        return None
    from damageest import Registry

    joints = Registry.discover().find_joints(robot.joints, poses, rotary)
    if joints is None:
        raise _refuse_joints(robot.joints)
    if joints.shape[1] < len(robot.limits):
        raise StageError(
            f"'{robot.joints}' has {joints.shape[1]} joints, and the machine file {len(robot.limits)} limits",
            "one pair of robot.limits for each joint",
        )
    if not np.isfinite(joints).all():
        wrong = np.flatnonzero(~np.isfinite(joints).all(axis=1))
        where = moves.describe(int(wrong[0]))
        raise StageError(f"{len(wrong)} of {len(poses)} poses have no joints: {where}", "another frames.work")
    for number, (low, high) in enumerate(robot.limits):
        beyond = np.maximum(low - joints[:, number], joints[:, number] - high)
        if beyond.max() > 1e-9:
            k = int(beyond.argmax())
            raise StageError(
                f"joint {number + 1} would be at {joints[k, number]:.1f}, beyond its limits of {low:g} to {high:g}: "
                f"{moves.describe(k)}",
                "another frames.work",
            )
    jumps = np.abs(np.diff(joints, axis=0)).max(axis=1, initial=0.0)
    short = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1) < 20.0
    if (jumps * short).max(initial=0.0) > WRIST:
        k = int((jumps * short).argmax()) + 1
        raise StageError(
            f"a joint would have to jump by {jumps[k - 1]:.0f} degrees: {moves.describe(k)}",
            "another frames.work, or another frames.tool.spin",
        )
    return joints
