"""What a machine cannot do is an error or told; rotary axes are chosen for the whole path."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damageest_machines.build import build_program
from damageest_machines.definition import Machine
from damageest_machines.files import list_shipped, read_machine
from damageest_machines.program import Program
from damageest_machines.rotary import choose_angles, measure_angle
from hypothesis import given, settings
from hypothesis import strategies as st
from machine_checks import load
from machine_readers import axis_of, frame_of, turn

from damageest.artefacts import DepositPath, Floats, Mesh
from damageest.errors import StageError
from damageest.stages.export import PathSettings

TIP = Mesh(np.array([[0, 0, 0], [1, 0, 1], [-1, 1, 1], [-1, -1, 1.0]]), np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1]]))


def make_path(axes: Floats, points: Floats | None = None, on: Any = True, **more: Any) -> DepositPath:
    """A pass along x through points with these tool axes; the first move goes there."""
    count = len(axes)
    places = np.column_stack([np.linspace(-20, 20, count), np.zeros((count, 2))]) if points is None else points
    deposits = np.full(count, on)
    deposits[0] = False
    numbers = np.ones(count, int)
    return DepositPath(
        places, axes / np.linalg.norm(axes, axis=1)[:, None], np.tile([0, 0, 1.0], (count, 1)), np.full(count, 600.0),
        deposits, numbers, numbers, numbers, np.array([[0, 0, 1.0]]), np.array([1.0]), 2.0, np.array([2.0]), 3.0, 80.0,
        TIP, 1.0, 1.0, **more,
    )  # fmt: skip


def tilt(azimuth: Any, angle: Any) -> Floats:
    a, t = np.broadcast_arrays(np.radians(azimuth), np.radians(angle))
    return np.stack([np.sin(t) * np.cos(a), np.sin(t) * np.sin(a), np.cos(t)], axis=-1)


def build(machine: str, path: DepositPath, **changes: Any) -> Program:
    """The program, with some fields of the machine file changed."""
    values = {**load(machine), **changes}
    return build_program(path, PathSettings("mm", "test site 1"), Machine.model_validate(values))


def limit(machine: str, name: str, low: float, high: float) -> dict[str, Any]:
    rotary = [{**axis, "limits": [low, high]} if axis["name"] == name else axis for axis in load(machine)["rotary"]]
    return {"rotary": rotary}


FIVE = ["linuxcnc_table_table", "sinumerik_table_table", "heidenhain_head_table", "sinumerik_head_head"]


@pytest.mark.slow
@pytest.mark.parametrize("machine", FIVE)
@settings(max_examples=10, deadline=None)
@given(st.lists(st.tuples(st.floats(-120, 120), st.floats(0, 80)), min_size=2, max_size=5))
def test_the_axes_stand_so_that_the_tool_does(machine: str, course: list[tuple[float, float]]) -> None:
    """For any course of the tool: the tool axis by the test's own kinematics, no jump, all within the limits."""
    corners = np.array(course)
    axes = np.concatenate([tilt(*np.linspace(a, b, 40).T) for a, b in pairwise(corners)])
    values = load(machine)
    program = build(machine, make_path(axes))
    names = [axis["name"] for axis in values["rotary"]]
    angles = [dict(zip(names, row, strict=True)) for row in program.at.rotary.tolist()]
    found = np.array([axis_of(values, each) for each in angles])
    assert np.degrees(measure_angle(found, program.moves.axes)).max() < 5e-4
    for number, axis in enumerate(values["rotary"]):
        if "limits" in axis:
            assert axis["limits"][0] - 1e-6 <= program.at.rotary[:, number].min()
            assert program.at.rotary[:, number].max() <= axis["limits"][1] + 1e-6
    between = (program.at.rotary[1:] + program.at.rotary[:-1]) / 2
    halfway = np.array([axis_of(values, dict(zip(names, row, strict=True))) for row in between.tolist()])
    planned = program.moves.axes[1:] + program.moves.axes[:-1]
    planned /= np.linalg.norm(planned, axis=1)[:, None]
    assert np.degrees(measure_angle(halfway, planned)).max() < 3.1


def test_the_other_solution_is_taken_early() -> None:
    """The tool goes round by 250 degrees. With A above 0 C would go from 0 to 250, with A
    below 0 from -180 to 70: what the limits permit is chosen at the beginning, not on the way."""
    path = make_path(tilt(np.linspace(-90, 160, 120), 40.0))
    for low, high in ((-200.0, 200.0), (-180.0, 75.0), (-10.0, 255.0)):
        program = build("sinumerik_head_head", path, **limit("sinumerik_head_head", "C", low, high))
        turns = np.abs(np.diff(program.at.rotary, axis=0))
        assert turns.max() < 5
        assert low <= program.at.rotary[:, 0].min()
        assert program.at.rotary[:, 0].max() <= high


def test_a_turn_for_which_the_axis_is_too_short_is_an_error() -> None:
    path = make_path(tilt(np.linspace(0, 350, 200), 40.0))
    with pytest.raises(StageError, match=r"(would have to jump|not reached).*pass 1 of layer 1"):
        build("sinumerik_head_head", path, **limit("sinumerik_head_head", "C", -100.0, 100.0))


@pytest.mark.parametrize("machine", FIVE)
def test_over_the_pole_no_axis_jumps(machine: str) -> None:
    """The tool tilts from one side to the other: the tilting axis goes through 0, and the other stays."""
    path = make_path(tilt(35.0, np.linspace(-50, 50, 81)))
    program = build(machine, path)
    turning = [axis["name"] for axis in load(machine)["rotary"]].index("C")
    assert np.ptp(program.at.rotary[:, turning]) < 1e-6
    assert not program.notes


@pytest.mark.parametrize("machine", FIVE)
def test_a_way_past_the_pole_is_told(machine: str) -> None:
    """A tenth of a degree beside the pole C has to turn by nearly half a turn: deposition is slower there."""
    axes = np.column_stack([np.linspace(-0.5, 0.5, 81), np.full(81, 0.002), np.ones(81)])
    program = build(machine, make_path(axes))
    assert any("slower than planned, because C turns" in note for note in program.notes)


@pytest.mark.parametrize(
    ("machine", "changes", "words"),
    [
        ("sinumerik_3_axes", {}, "no rotary axes, but the tool is tilted by 30.0 degrees"),
        ("sinumerik_table_table", limit("sinumerik_table_table", "A", -20, 20), "not reached by A and C"),
        ("linuxcnc_table_table", {"approach": 600.0}, "Z would be at .*, beyond its limits of -700 to 0"),
        ("kuka", {"frames": {**load("kuka")["frames"], "work": {"position": [2500, 0, 0]}}}, "out of the reach"),
        ("kuka", {"frames": {**load("kuka")["frames"], "work": {"position": [300, 0, 500]}}}, "out of the reach"),
    ],
)
def test_what_the_machine_cannot_do_is_an_error(machine: str, changes: dict[str, Any], words: str) -> None:
    with pytest.raises(StageError, match=words):
        build(machine, make_path(tilt(np.full(20, 20.0), 30.0)), **changes)


def test_channels_without_a_command_or_beyond_its_limits_are_refused() -> None:
    path = make_path(tilt(np.zeros(5), 0.0))
    for name, value, words in (("laser", 1.0, "no command"), ("power", 9000.0, "beyond the limits")):
        with pytest.raises(StageError, match=words):
            build("kuka", replace(path, channels=(name,), values=np.full((5, 1), value)))


def test_the_positioner_brings_the_tool_axis_upright() -> None:
    """By the angles of the program and the kinematics of the test, the nozzle points down all along."""
    path = make_path(tilt(np.linspace(0, 200, 90), np.linspace(5, 60, 90)))
    program, values = build("kuka_positioner", path), load("kuka_positioner")
    base = frame_of(values)
    for row, axis, point, place in zip(
        program.at.rotary.tolist(), program.moves.axes, program.moves.points, program.at.linear, strict=True
    ):
        R, s = turn(values, dict(zip(("E1", "E2"), row, strict=True)), "part")
        assert np.abs(R @ base[:3, :3] @ axis - [0, 0, 1]).max() < 1e-6
        assert np.abs(R @ (base[:3, :3] @ point + base[:3, 3]) + s - place).max() < 1e-6


def test_joints_come_from_a_hook_and_are_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    from damageest import Registry, hookimpl

    class Arm:
        joints = np.zeros((0, 6))

        @hookimpl
        def damageest_kinematics(self, machine: str, poses: Floats, turns: Floats) -> Floats | None:
            assert poses.shape[1:] == (4, 4)
            return Arm.joints[: len(poses)] if machine == "arm" else None

    discover = Registry.discover
    monkeypatch.setattr(Registry, "discover", lambda: discover([Arm()]))
    path = make_path(tilt(np.zeros(5), 0.0))
    robot = {**load("kuka")["robot"], "joints": "arm", "limits": [[-100, 100]] * 6}
    Arm.joints = np.zeros((7, 6))
    program = build("kuka", path, robot=robot)
    assert program.at.joints is not None
    assert not program.notes
    for row, value, words in ((3, np.nan, "have no joints"), (3, 120.0, "beyond its limits"), (3, 60.0, "jump by 60")):
        Arm.joints = np.zeros((7, 6))
        Arm.joints[row, 4] = value
        with pytest.raises(StageError, match=words):
            build("kuka", path, robot=robot)
    for wrong, words in (
        (np.zeros((7, 5)), "'arm' has 5 joints, and the machine file 6 limits"),
        (np.zeros(7), r"gave \(7,\) joints for 7 poses of 'arm'"),
        ([["a"]] * 7, "gave a list that holds no joints for 7 poses of 'arm'"),
        (7, "the observer Arm failed in its hook damageest_kinematics for 'arm': TypeError"),
    ):
        Arm.joints = wrong  # type: ignore[assignment]
        with pytest.raises(StageError, match=words):
            build("kuka", path, robot=robot)
    with pytest.raises(StageError, match="no plugin gives joints for 'other'"):
        build("kuka", path, robot={**robot, "joints": "other"})


def test_time_has_accelerations() -> None:
    """40 mm at 10 mm a second, from standstill to standstill, with 1 mm/s2: the ramps take 10 s more."""
    straight = tilt(np.zeros(2), 0.0)
    linear = [{**axis, "acceleration": 1.0} for axis in load("linuxcnc_3_axes")["linear"]]
    values = load("linuxcnc_3_axes")
    process = {**values["process"], "on": {"lines": [], "wait": 2.0}, "off": {"lines": [], "wait": 1.0}}
    slow = build("linuxcnc_3_axes", make_path(straight), linear=linear, approach=0.0, retract=0.0, process=process)
    fast = build("linuxcnc_3_axes", make_path(straight), approach=0.0, retract=0.0, process=process)
    # it reaches sqrt(40) mm/s at half of the way: 2 sqrt(40) seconds
    assert slow.minutes * 60 == pytest.approx(2 * np.sqrt(40.0) + 3.0, rel=1e-6)
    assert fast.minutes * 60 == pytest.approx(4.0 + 10 / 2000 + 3.0, rel=1e-6)


def test_shipped_machines_are_valid() -> None:
    kinds = {name: read_machine(file) for name, file in list_shipped().items()}
    carried = {tuple(axis.carries for axis in machine.rotary) for machine in kinds.values() if machine.robot is None}
    assert carried == {(), ("part", "part"), ("tool", "part"), ("tool", "tool")}
    assert any(machine.robot and machine.rotary for machine in kinds.values())


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name: a\n", "process"),
        ("name: a\nprocess: {on: {}, off: {}}\n", "needs linear axes X, Y, Z"),
        ("name: a\nprocess: {on: {}, off: {}}\nspeed: 3\n", r"machine.yaml:3: speed"),
        ("name: a\nprocess: {on: {}, off: {}}\nrotary: [{name: A}]\n", r"machine.yaml:3: rotary.0"),
    ],
)
def test_a_wrong_machine_file_is_told_with_its_line(text: str, words: str, tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    file.write_text(text)
    with pytest.raises(StageError, match=words):
        read_machine(file)


def test_a_single_rotary_axis_reaches_one_plane() -> None:
    rotary = [axis for axis in read_machine(list_shipped()["sinumerik_head_head"]).rotary if axis.name == "A"]
    up = np.array([0, 0, 1.0])
    on = np.ones(9, bool)
    fine = choose_angles(rotary, tilt(90.0, np.linspace(-40, 40, 9)), up, on, np.zeros(1))
    assert not len(fine.unreached)
    assert np.abs(fine.angles[:, 0] + np.linspace(-40, 40, 9)).max() < 1e-9
    assert len(choose_angles(rotary, tilt(0.0, np.linspace(10, 40, 9)), up, on, np.zeros(1)).unreached) == 9
