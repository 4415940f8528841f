"""Trials of build directions: one that is given up changes nothing."""

from __future__ import annotations

import damageest_paths.directions
import numpy as np
import pytest
from damageest_paths.directions import choose_direction
from damageest_paths.frames import Frame
from damageest_paths.planar import Surroundings, plan_planar
from damageest_paths.process import Plan, Process
from path_cavities import pocket, prepare, stair

from tests.path_shapes import Loss


@pytest.mark.parametrize("loss", [pocket(), stair()])
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
    monkeypatch.setattr(damageest_paths.directions, "CLEARLY_WORSE", np.inf)
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
