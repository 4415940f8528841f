"""Directions and floors that are tried: a trial that is given up changes nothing, and the order of floors does not."""

from __future__ import annotations

import damageest_paths.layering.conformal
import damageest_paths.layering.directions
import numpy as np
import pytest
from damageest_paths.layering.conformal import plan_conformal
from damageest_paths.layering.directions import choose_direction
from damageest_paths.layering.planar import Surroundings, plan_planar
from damageest_paths.process.frames import Frame
from damageest_paths.process.process import Plan, Process
from damageest_paths.sheets.floor import Floor, make_floor
from manifold3d import Manifold
from path_cavities import pocket, prepare, stair

from tests.path_shapes import BLOCK, Loss, cut

SMALL = cut(BLOCK, Manifold.cube((10, 8, 12)).translate((-5, -4, -6)))
"""A pocket 6 deep."""


@pytest.mark.slow
@pytest.mark.parametrize("loss", [SMALL, pocket(), stair()])
def test_trials_given_up_are_those_of_no_chosen_direction(loss: Loss, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = prepare(loss, shortest=1.0)
    directions = [
        np.array(one) / np.linalg.norm(one) for one in ([1, 0, 0.2], [0, 0.3, 1], [0, 0, 1.0], [0.0, -1, 0.5])
    ]
    trials: list[tuple[int, float]] = []

    def run(body: object, frame: Frame, around: Surroundings, process: Process) -> Plan:
        plan = plan_planar(body, frame, around, process)
        if process.is_trial:
            trials.append((len(plan.passes), plan.missing_volume))
        return plan

    def choose() -> Plan:
        trials.clear()
        return choose_direction(scene.body, np.zeros(3), directions, scene.around, scene.process, run)

    plan, some = choose(), list(trials)
    monkeypatch.setattr(damageest_paths.layering.directions, "CLEARLY_WORSE", np.inf)
    whole, every = choose(), list(trials)
    given_up = [one for one, (passes, _) in enumerate(some) if not passes]
    assert given_up
    assert any(every[one][0] for one in given_up)
    lost = [volume for _, volume in every]
    assert int(np.argmin(lost)) not in given_up
    for one in range(len(directions)):
        if one in given_up:
            assert some[one][1] == pytest.approx(scene.body.volume(), rel=0.02)
            assert lost[one] > min(lost)
        else:
            assert some[one] == every[one]
    assert (plan.frame.direction == whole.frame.direction).all()
    assert plan.missing_volume == whole.missing_volume


@pytest.mark.slow
def test_of_floors_that_leave_much_uncovered_the_one_that_leaves_least_is_filled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = prepare(stair())
    whole = scene.floor.mesh
    upper = whole.triangles[:, :, 2].mean(axis=1) > 0
    floors = [
        make_floor(whole.vertices + np.array([0.0, 0.0, raised]), whole.faces[some], scene.process.bead.width)
        for some, raised in ((upper, 0.5), (upper, 0.0), (~upper, 0.0))
    ]
    uncovered: list[float] = []

    def plan_over(some: list[Floor]) -> Plan:
        monkeypatch.setattr(
            damageest_paths.layering.conformal, "list_floors", lambda *_: iter([(one, 1.0) for one in some])
        )
        uncovered.clear()
        return plan_conformal(scene.body, scene.frame, scene.around, scene.process, 1.0, uncovered.append)

    plan_over(floors[:2])
    assert uncovered[0] > 1.1 * uncovered[1] > 0.1 * scene.body.volume()
    wanted = plan_over([floors[1]])
    for some in (floors[:2], floors[1::-1]):
        plan = plan_over(some)
        assert len(uncovered) == 2
        assert plan.missing_volume == wanted.missing_volume
        assert len(plan.passes) == len(wanted.passes)
    # one that leaves little is filled at once
    assert plan_over(floors[::-1]).missing_volume < 0.1 * scene.body.volume() < wanted.missing_volume
    assert len(uncovered) == 1
