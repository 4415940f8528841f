"""Datum systems with precedence: what each datum fixes, what stays free, and which datums are no good."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from damageest_benchmarks.parts import PARTS
from damageest_evaluate.scores import measure_pose_error
from pydantic import ValidationError

from damageest.artefacts import Part, Pose
from damageest.errors import StageError
from damageest.stages.align.icp import Icp
from tests.stages.align.datum_scenes import Scene, make_flange, make_knob, make_mushroom, make_worn, scan_part


def box(low: list[float], high: list[float]) -> list[dict[str, Any]]:
    return [{"box": [low, high]}]


def face(part: Part, axis: int, end: int) -> list[dict[str, Any]]:
    """The flat face at one end of an axis."""
    low, high = part.bounds[0] - 1, part.bounds[1] + 1
    low[axis], high[axis] = part.bounds[end][axis] - 0.01, part.bounds[end][axis] + 0.01
    return box(low.tolist(), high.tolist())


CUBOID, KNOB, FLANGE, MUSHROOM = PARTS["cuboid"](), make_knob(), make_flange(), make_mushroom()
BOTTOM, TOP, SIDE, BACK = (face(CUBOID, *of) for of in ((2, 0), (2, 1), (1, 0), (0, 0)))
SHAFT, CONE = box([-11, -11, -19], [11, 11, -1]), box([-11, -11, 0.5], [11, 11, 9.5])
BALL, END = box([-11, -11, 12], [11, 11, 30]), face(KNOB, 2, 0)
BORE, OTHER = box([-32, 3, -4], [-18, 17, 4]), box([18, 3, -4], [32, 17, 4])
FLAT = face(FLANGE, 2, 0)

LEFT = {
    "plane": (CUBOID, {"A": BOTTOM}, "turn z, shift x, shift y"),
    "two planes": (CUBOID, {"A": BOTTOM, "B": SIDE}, "shift x"),
    "3-2-1": (CUBOID, {"A": BOTTOM, "B": SIDE, "C": BACK}, ""),
    "parallel planes": (CUBOID, {"A": BOTTOM, "B": TOP}, "turn z, shift x, shift y"),
    "cylinder": (KNOB, {"A": SHAFT}, "turn z, shift z"),
    "cylinder and plane": (KNOB, {"A": SHAFT, "B": END}, "turn z"),
    "sphere": (KNOB, {"A": BALL}, "turn x, turn y, turn z"),
    "cone": (KNOB, {"A": CONE}, "turn z"),
    "plane and bore": (FLANGE, {"A": FLAT, "B": BORE}, "turn z"),
    "plane and pattern": (FLANGE, {"A": FLAT, "B": [*BORE, *OTHER]}, ""),
}
"""Part, datum system, and the degrees of freedom that it leaves."""


@cache
def scan(name: str) -> Scene:
    return scan_part({"cuboid": CUBOID, "knob": KNOB, "flange": FLANGE}[name])


def name_motions(pose: Pose) -> str:
    kinds = ["shift" if one.point is None else "turn" for one in pose.left]
    return ", ".join(
        f"{kind} {'xyz'[int(np.argmax(np.abs(one.direction)))]}" for kind, one in zip(kinds, pose.left, strict=True)
    )


@pytest.mark.variants(2)
@pytest.mark.parametrize("name", LEFT)
def test_what_stays_free_is_named(name: str) -> None:
    part, datum, left = LEFT[name]
    scene = scan({id(CUBOID): "cuboid", id(KNOB): "knob", id(FLANGE): "flange"}[id(part)])
    pose = scene.align(datum)
    assert name_motions(pose) == left
    assert all(max(np.abs(one.direction)) > 0.999 for one in pose.left)
    assert any("degrees of freedom" in note or "1 degree" in note for note in pose.notes) == bool(left)
    assert sum(len(one.takes) for one in pose.datums) + len(pose.left) == 6
    assert measure_pose_error(part, pose.T_part_scan, np.eye(4))[0] < 0.25 * scene.scan.noise
    assert not pose.doubts


def test_a_turn_that_is_left_is_about_the_bore() -> None:
    (turn,) = scan("flange").align({"A": FLAT, "B": BORE}).left
    assert turn.point is not None
    assert turn.point[:2] == pytest.approx((-25, 10), abs=0.1)


def test_a_datum_that_fixes_nothing_is_named() -> None:
    pose = scan("cuboid").align({"A": BOTTOM, "B": TOP})
    assert pose.datums[1].takes == ()
    assert any("datum B (plane) has no effect" in note for note in pose.notes)


def test_precedence_decides_which_datum_gives_way() -> None:
    """The side leans by 3 tolerances over its height: as A it turns the part, as B it does not."""
    part, noise = CUBOID, scan("cuboid").scan.noise
    scene = scan_part(part)
    points = scene.scan.points.copy()
    side = points[:, 1] < part.bounds[0, 1] + 5 * noise
    height = float(np.ptp(part.bounds[:, 2]))
    lean = 3 * scene.tolerance / height
    points[side, 1] += lean * (points[side, 2] - part.bounds[0, 2])
    leaning = Scene(part, type(scene.scan)(points, noise=noise), scene.tolerance)
    turns = []
    for datum in ({"A": BOTTOM, "B": SIDE, "C": BACK}, {"A": SIDE, "B": BOTTOM, "C": BACK}):
        turns.append(abs(leaning.align(datum).T_part_scan[1, 2]))
    assert turns[0] < 0.02 * lean
    assert turns[1] == pytest.approx(lean, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "points"), [("cuboid", 12_000), pytest.param("half_torus", 60_000, marks=pytest.mark.slow)]
)
def test_wear_beside_the_datums_does_not_move_the_pose(name: str, points: int) -> None:
    scene, datums = make_worn(name, 0, points)
    pose, free = scene.align(datums), scene.align([])
    errors = [measure_pose_error(scene.part, one.T_part_scan, np.eye(4))[1] for one in (pose, free)]
    assert errors[0] < 0.5 * scene.scan.noise < errors[1]
    assert pose.is_held
    assert all(one.effect == "note" for one in pose.doubts)
    assert pose.spread is not None


FIXED = ("block", "half_torus", "blade", "keyed_shaft", "grille", "ribbed_plate", "lever", "coupling", "cuboid")


@pytest.mark.slow
def test_twenty_worn_parts() -> None:
    """All faces but the datums are worn by 1 to 4 tolerances, each by another amount."""
    cases = [(name, first) for name in FIXED for first in (0, 1)] + [("block", 2), ("cuboid", 2)]
    errors = []
    for name, first in cases:
        scene, datums = make_worn(name, first)
        row = []
        for datum in (datums, []):
            T = scene.align(datum).T_part_scan
            row.append(measure_pose_error(scene.part, T, np.eye(4))[1] / scene.scan.noise)
        print(name, first, np.round(row, 3))
        errors.append(row)
    by_datum, free = np.array(errors).T
    print("median", np.median(by_datum), np.median(free), "largest", by_datum.max(), free.max())
    assert np.median(by_datum) < 0.2
    assert by_datum.max() < 1.0
    assert free.max() > 5.0


def test_a_datum_that_is_worn_in_part_is_fitted_to_the_rest() -> None:
    depth = np.zeros(len(CUBOID.faces))
    scene = scan_part(CUBOID, depth)
    points = scene.scan.points.copy()
    worn = (points[:, 2] < CUBOID.bounds[0, 2] + 0.1) & (points[:, 0] > 0.2 * CUBOID.bounds[1, 0])
    points[worn, 2] += 2.5 * scene.tolerance
    pose = Scene(CUBOID, type(scene.scan)(points, noise=scene.scan.noise), scene.tolerance).align(LEFT["3-2-1"][1])
    assert measure_pose_error(CUBOID, pose.T_part_scan, np.eye(4))[1] < 0.3 * scene.scan.noise
    assert any("datum A" in note and "count as worn" in note for note in pose.notes)
    assert 0.2 < pose.datums[0].inside < 0.6


def test_a_datum_that_is_worn_all_over_is_doubted() -> None:
    """The pose moves to the datum. Of a cuboid, the opposite face looks worn then; a step that faces as the datum
    does lies outside."""
    down = CUBOID.face_normals[:, 2] < -0.9
    scene = scan_part(CUBOID, np.where(down, 2.5, 0.0))
    pose = scene.align(LEFT["3-2-1"][1])
    assert [(one.code, one.effect) for one in pose.doubts] == [("datum_decides", "note")]
    assert pose.doubts[0].amount == pytest.approx(2.5 * scene.tolerance, rel=0.2)
    foot = MUSHROOM.triangles[:, :, 2].max(axis=1) < -29
    stepped = scan_part(MUSHROOM, np.where(foot, 2.5, 0.0)).align({"A": face(MUSHROOM, 2, 0)})
    assert ("datum_worn", "contradicts") in [(one.code, one.effect) for one in stepped.doubts]
    assert not stepped.is_held


def test_a_list_of_datums_is_asked_as_a_system_is() -> None:
    down = CUBOID.face_normals[:, 2] < -0.9
    pose = scan_part(CUBOID, np.where(down, 2.5, 0.0)).align(BOTTOM)
    assert [(one.code, one.effect) for one in pose.doubts] == [("datum_decides", "note")]
    assert not scan_part(CUBOID).align(BOTTOM).doubts


@pytest.mark.parametrize("share", [0.0, 0.04])
def test_a_datum_that_the_scan_does_not_show(share: float) -> None:
    """Without points it is refused; a narrow strip does not fix how the part is turned."""
    scene, low = scan_part(CUBOID, points=12_000), CUBOID.bounds[0]
    points = scene.scan.points
    width = float(np.ptp(CUBOID.bounds[:, 1]))
    hidden = (points[:, 2] < low[2] + 0.1) & (points[:, 1] > low[1] + share * width)
    seen = Scene(CUBOID, scene.scan.take(~hidden), scene.tolerance)
    if not share:
        with pytest.raises(StageError, match="does not show datum A"):
            seen.align({"A": BOTTOM})
        return
    pose = seen.align({"A": BOTTOM})
    assert any("its scanned part does not fix a turn about (1.00" in note for note in pose.notes)
    assert name_motions(pose) == "turn x, turn z, shift x, shift y"
    assert measure_pose_error(CUBOID, pose.T_part_scan, np.eye(4))[1] < 0.3 * scene.scan.noise


def test_one_sided_lies_on_the_highest_places() -> None:
    """A bottom that is hollow in the middle by 2 tolerances: a plate touches its rim."""
    scene = scan("cuboid")
    points = scene.scan.points.copy()
    bottom = points[:, 2] < CUBOID.bounds[0, 2] + 0.1
    across = points[:, 0] / CUBOID.bounds[1, 0]
    points[bottom, 2] += 2 * scene.tolerance * (1 - across[bottom] ** 2)
    hollow = Scene(CUBOID, type(scene.scan)(points, noise=scene.scan.noise), scene.tolerance)
    pose = hollow.align({"A": {"skin": BOTTOM, "fit": "one_sided"}, "B": SIDE, "C": BACK})
    assert abs(pose.T_part_scan[2, 3]) < 0.35 * scene.tolerance


@pytest.mark.parametrize(
    ("datum", "text"),
    [
        ({}, "at least 1"),
        ({"A": []}, "at least 1"),
        ({"a": [1]}, "match"),
        ({"A": [1], "B": [2], "C": [3], "D": [4]}, "at most 3"),
        ({"A": {"skin": [1], "fit": "tight"}}, "one_sided"),
    ],
)
def test_what_is_no_datum_system(datum: Any, text: str) -> None:
    with pytest.raises(ValidationError, match=text):
        Icp.model_validate({"datum": datum})


def test_a_face_without_a_shape_is_refused() -> None:
    blade = PARTS["blade"]()
    with pytest.raises(StageError, match="no plane, cylinder, cone or sphere"):
        scan_part(blade).align({"A": [{"half_space": {"point": [0, 0, 5], "normal": [0, 0, 1]}}]})
