"""The tool axes that a machine reaches, so that a path is planned with these alone."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from damageest.artefacts import Floats
from damageest_machines.definition import Machine, Rotary
from damageest_machines.frames import make_transform
from damageest_machines.rotary import find_order

ROUND, STEPS = 360.0, 1440
"""Degrees of a whole turn, and places of the other axis that are looked at."""


def find_reach(machine: Machine) -> Floats | None:
    """A unit vector in the work offset, and the least and largest cosine (5,) of the angle of the tool axes with it
    that two rotary axes reach, where the one next to the part turns all round; None for other machines."""
    if not machine.follows or len(machine.rotary) != 2:
        return None
    flat = np.array(machine.robot.flat if machine.robot else (0.0, 0.0, 1.0))
    first, second = (machine.rotary[k] for k in find_order(machine.rotary))
    if not _turns_round(first):
        return None
    u1, u2 = (np.array(axis.direction) / np.linalg.norm(axis.direction) for axis in (first, second))
    low, high = second.limits or (-ROUND / 2, ROUND / 2)
    # a table turns the part the other way
    sign = -1.0 if second.carries == "part" else 1.0
    angles = np.radians(sign * np.linspace(low, high, STEPS + 1))
    cosines = Rotation.from_rotvec(angles[:, None] * u2).apply(flat / np.linalg.norm(flat)) @ u1
    base = make_transform(machine.frames.work)[:3, :3]
    return np.append(u1 @ base, [cosines.min(), cosines.max()])


def _turns_round(axis: Rotary) -> bool:
    return axis.limits is None or axis.limits[1] - axis.limits[0] >= ROUND
