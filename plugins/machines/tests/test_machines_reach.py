"""The tool axes that a machine reaches are those for which angles are found."""

from __future__ import annotations

import numpy as np
import pytest
from damageest_machines.files import list_shipped, read_machine
from damageest_machines.reach import find_reach
from damageest_machines.rotary import choose_angles

from damageest.geometry.vectors import normalise


@pytest.mark.parametrize("name", ["kuka_positioner", "sinumerik_table_table", "sinumerik_head_head"])
def test_what_is_reached_has_angles(name: str) -> None:
    machine = read_machine(list_shipped()[name])
    reach = find_reach(machine)
    assert reach is not None
    axes = normalise(np.random.default_rng(1).normal(size=(300, 3)))
    cosine = axes @ reach[:3]
    expected = (cosine >= reach[3]) & (cosine <= reach[4])
    flat = np.array(machine.robot.flat if machine.robot else (0.0, 0.0, 1.0))
    found = choose_angles(machine.rotary, axes, flat, np.ones(300, bool), np.zeros(2))
    assert 0 < expected.sum() < 300
    assert sorted(found.unreached.tolist()) == np.flatnonzero(~expected).tolist()


def test_machines_without_two_rotary_axes_have_no_reach() -> None:
    assert find_reach(read_machine(list_shipped()["sinumerik_3_axes"])) is None
