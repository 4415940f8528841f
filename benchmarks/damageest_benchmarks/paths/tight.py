"""Deposits at places where the straight way to them is not free: beside a wall, under a flange or a ledge, between
blades, inside a bore."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np


class Loss(NamedTuple):
    """A part and the tool that takes its loss away, both Manifolds."""

    part: Any
    tool: Any


def _make_box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Any:
    from manifold3d import Manifold

    return Manifold.cube(tuple(np.subtract(high, low).tolist())).translate(low)


def _make_dent(rng: np.random.Generator, deep: float, wide: float) -> Any:
    """A flat ball or a box, centred at 0, twice as high along z as it is ``deep``."""
    from manifold3d import Manifold

    long = wide * float(rng.uniform(1.0, 2.0))
    if rng.random() < 0.5:
        return Manifold.sphere(1.0, 48).scale((long / 2, wide / 2, deep))
    return Manifold.cube((long, wide, 2 * deep), True)


def make_wall(rng: np.random.Generator) -> Loss:
    """A dent in a plate beside a high wall, some millimetres from it."""
    part = _make_box((-40, -40, -15), (40, 10, 0)) + _make_box((-40, 4, 0), (40, 10, float(rng.uniform(25, 45))))
    wide, deep = float(rng.uniform(6, 12)), float(rng.uniform(1.5, 3.5))
    return Loss(part, _make_dent(rng, deep, wide).translate((0, 4 - wide / 2 - float(rng.uniform(0.5, 4)), 0)))


def make_flange(rng: np.random.Generator) -> Loss:
    """A dent in a shaft under its flange."""
    from manifold3d import Manifold

    radius, out = float(rng.uniform(12, 18)), float(rng.uniform(12, 25))
    part = Manifold.cylinder(60, radius, radius, 96).translate((0, 0, -60)) + Manifold.cylinder(
        8, radius + out, radius + out, 96
    )
    wide, deep = float(rng.uniform(6, 11)), float(rng.uniform(1.5, 3))
    angle = float(rng.uniform(0, 2 * np.pi))
    dent = _make_dent(rng, deep, wide).rotate((0, 90, 0)).rotate((0, 0, float(np.degrees(angle))))
    down = -wide - float(rng.uniform(0.5, 4))
    return Loss(part, dent.translate((radius * np.cos(angle), radius * np.sin(angle), down)))


def make_passage(rng: np.random.Generator) -> Loss:
    """A dent in the side of a blade of a row, that looks on to the next blade."""
    gap, high = float(rng.uniform(16, 24)), float(rng.uniform(22, 32))
    part = _make_box((-20, -gap - 8, -8), (20, gap + 8, 0))
    for number in (-1, 0, 1):
        part += _make_box((-20, number * gap - 2.5, -1), (20, number * gap + 2.5, high))
    wide, deep = float(rng.uniform(6, 9)), float(rng.uniform(1.2, 2.2))
    dent = _make_dent(rng, deep, wide).rotate((90, 0, 0))
    return Loss(part, dent.translate((float(rng.uniform(-4, 4)), 2.5, high - wide / 2 - float(rng.uniform(1, 5)))))


def make_ledge(rng: np.random.Generator) -> Loss:
    """A dent in the floor of a slot under a ledge, near its open side."""
    high = float(rng.uniform(18, 26))
    part = _make_box((-35, 0, -12), (35, 30, high + 8)) - _make_box((-40, -1, 0), (40, 20, high))
    wide, deep = float(rng.uniform(5, 9)), float(rng.uniform(1.5, 3))
    return Loss(part, _make_dent(rng, deep, wide).translate((0, wide / 2 + float(rng.uniform(1, 3)), 0)))


def make_inner(rng: np.random.Generator) -> Loss:
    """A dent in the wall of a bore, some millimetres below its mouth."""
    from manifold3d import Manifold

    radius = float(rng.uniform(14, 24))
    part = Manifold.cylinder(40, radius + 10, radius + 10, 96).translate((0, 0, -40)) - Manifold.cylinder(
        120, radius, radius, 96, True
    )
    wide, deep = float(rng.uniform(6, 10)), float(rng.uniform(1.5, 3))
    dent = _make_dent(rng, deep, wide).rotate((90, 0, 90))
    return Loss(part, dent.translate((radius, 0, -wide / 2 - float(rng.uniform(2, 5)))))


TIGHT: dict[str, Callable[[np.random.Generator], Loss]] = {
    "wall": make_wall,
    "flange": make_flange,
    "passage": make_passage,
    "ledge": make_ledge,
    "inner": make_inner,
}
