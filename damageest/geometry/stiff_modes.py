"""A smooth displacement in words: by how much it scales, stretches, bends, twists and tapers a part."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.transforms import remove_rigid

LEAST = 0.05
"""Share of what is left that a mode has to explain, in squares, to be named."""
MOST = 8
"""Modes that are named at most."""


class StiffMode(NamedTuple):
    """``kind``: scale, stretch, bend, twist or taper; ``axis``: along which the part is longer, about which it turns,
    along which cross-sections grow, or that becomes an arc."""

    kind: str
    axis: Annotated[str, "x, y or z of the part's frame: axis of a stretch, bend, twist or taper; empty for scale"]
    toward: Annotated[str, "direction to which the ends of a bend go; else empty"]
    amount: Annotated[float, "largest displacement by this mode beyond a rigid motion; negative: the other way"]


def name_modes(places: Floats, displacement: Floats) -> tuple[list[StiffMode], float]:
    """The modes of a displacement (N,3) of places (N,3), spread evenly over skin, the largest first; and the root mean
    square of the rest. Each mode explains most of the remaining displacement; all are fitted together by least
    squares."""
    if len(places) < 4:
        return [], 0.0
    even = np.ones(len(places))
    target = remove_rigid(places, displacement, even)
    shapes = {name: remove_rigid(places, shape, even) for name, shape in _make_shapes(places)}
    shapes = {name: shape / largest for name, shape in shapes.items() if (largest := _measure(shape)) > 1e-9}
    chosen: list[tuple[str, str, str]] = []
    found: Floats
    left, found = target, np.zeros(0)
    while len(chosen) < MOST:
        explained = {
            name: float((shape * left).sum()) ** 2 / float((shape**2).sum())
            for name, shape in shapes.items()
            if name not in chosen
        }
        best = max(explained, key=lambda name: explained[name], default=None)
        if best is None or explained[best] <= LEAST * float((target**2).sum()):
            break
        chosen.append(best)
        matrix = np.stack([shapes[name].ravel() for name in chosen], axis=1)
        found = np.asarray(np.linalg.lstsq(matrix, target.ravel(), rcond=1e-9)[0])
        left = target - (matrix @ found).reshape(target.shape)
    modes = [StiffMode(*name, float(amount)) for name, amount in zip(chosen, found, strict=True)]
    modes.sort(key=lambda mode: -abs(mode.amount))
    return modes, float(np.sqrt((left**2).sum(axis=1).mean()))


def _measure(shape: Floats) -> float:
    return float(np.linalg.norm(shape, axis=1).max())


def _make_shapes(places: Floats) -> Iterator[tuple[tuple[str, str, str], Floats]]:
    """Kind, axis and direction of each mode, with its displacements, to first order."""
    low, high = places.min(axis=0), places.max(axis=0)
    q = (places - (low + high) / 2) / float((high - low).max())
    yield ("scale", "", ""), q
    for a, axis in enumerate("xyz"):
        along, unit = q[:, a], np.eye(3)[a]
        yield ("stretch", axis, ""), along[:, None] * unit
        yield ("twist", axis, ""), along[:, None] * np.cross(unit, q)
        yield ("taper", axis, ""), along[:, None] * (q - along[:, None] * unit)
        for b, toward in enumerate("xyz"):
            if b != a:
                yield ("bend", axis, toward), along[:, None] ** 2 * np.eye(3)[b] - 2 * (along * q[:, b])[:, None] * unit
