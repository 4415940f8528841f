"""Troubles of wear: whole faces, half a shaft, a bore, or all of the skin is lower by some tolerances."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.solids import to_manifold
from damageest_benchmarks.troubles.lost import make_box
from damageest_benchmarks.troubles.scene import Scanning, TroubleScene
from damageest_benchmarks.troubles.ways import Trouble, TroubleWay

FAR = 1000.0
"""Half the edge of a box that stands for half of space, in mm."""

BORES: dict[str, tuple[float, float, float]] = {
    "gear": (0.0, 0.0, 12.0),
    "tube": (0.0, 0.0, 19.0),
    "coupling": (0.0, 0.0, 13.5),
    "lever": (0.0, 0.0, 10.0),
    "plate": (28.0, -15.0, 5.0),
    "ribbed_plate": (28.0, -6.0, 8.0),
}
"""Part: x and y of the axis of its bore along z, and the radius in mm about it within which the bore is worn."""


def wear_one_face(case: Scanning) -> TroubleScene:
    """The skin of the top face is lower by ``amount`` tolerances."""
    return case.scan(*case.cut(_take_top(case, case.amount)))


def wear_both_faces(case: Scanning) -> TroubleScene:
    """Top and bottom face are lower by ``amount`` tolerances each."""
    low = case.part.bounds[0]
    depth = case.amount * case.tolerance
    bottom = make_box((-FAR, -FAR, -FAR), (FAR, FAR, float(low[2]) + depth))
    return case.scan(*case.cut(_take_top(case, case.amount) + bottom))


def wear_wedge(case: Scanning) -> TroubleScene:
    """The top face is worn from nothing at one end of x to ``amount`` tolerances at the other."""
    low, high = case.part.bounds
    depth = case.amount * case.tolerance
    slope = float(np.degrees(np.arctan2(depth, high[0] - low[0])))
    wedge = make_box((-FAR, -FAR, 0.0), (FAR, FAR, FAR)).rotate((0, slope, 0))
    return case.scan(*case.cut(wedge.translate((float(low[0]), 0, float(high[2])))))


def wear_half_shaft(case: Scanning) -> TroubleScene:
    """The round skin of a shaft along z is lower by ``amount`` tolerances on the side of positive x, ends excepted."""
    return case.scan(*case.cut(_erode(case, _turn_about_z(24), lambda body: make_box((0, -FAR, -FAR), (FAR,) * 3))))


def wear_journal(case: Scanning) -> TroubleScene:
    """As `wear_half_shaft`, over the middle half of the length only: the ends stay as they are."""
    low, high = case.part.bounds[:, 2]
    box = make_box((0, -FAR, float(0.75 * low + 0.25 * high)), (FAR, FAR, float(0.25 * low + 0.75 * high)))
    return case.scan(*case.cut(_erode(case, _turn_about_z(24), lambda body: box)))


def wear_bore(case: Scanning) -> TroubleScene:
    """All of a bore is wider by ``amount`` tolerances in radius."""
    from manifold3d import Manifold

    x, y, radius = BORES[case.name]
    rod = Manifold.cylinder(2 * FAR, radius, radius, 128, True).translate((x, y, 0))
    return case.scan(*case.cut(_erode(case, _turn_about_z(32), lambda body: rod)))


def wear_all_over(case: Scanning) -> TroubleScene:
    """All of the skin is lower by about ``amount`` tolerances, but for a spot of 1 mm: without it the inner surface of
    the loss would be a body of its own."""
    spot = case.part.vertices[int(np.argmax(case.part.vertices @ np.array([0.6, 0.5, 0.7])))]
    kept = make_box((-FAR,) * 3, (FAR,) * 3) - make_box(tuple(spot - 0.5), tuple(spot + 0.5))
    directions = [*np.eye(3), *-np.eye(3), *_turn_about_z(16)]
    return case.scan(*case.cut(_erode(case, directions, lambda body: kept)))


def _take_top(case: Scanning, amount: float) -> Any:
    """All space above the top face lowered by ``amount`` tolerances."""
    height = float(case.part.bounds[1][2] - amount * case.tolerance)
    return make_box((-FAR, -FAR, height), (FAR, FAR, FAR))


def _erode(case: Scanning, directions: Sequence[Floats], choose: Callable[[Any], Any]) -> Any:
    """The layer of ``amount`` tolerances below the part's skin, inside the solid that ``choose`` gives.

    What is left of a body lies in each of its copies that are moved by the depth in one of the ``directions`` (3,).
    """
    body = to_manifold(case.part)
    left = body
    for way in directions:
        left ^= body.translate(tuple(case.amount * case.tolerance * np.asarray(way)))
    return (body - left) ^ choose(body)


def _turn_about_z(count: int) -> list[Floats]:
    """Unit vectors (3,) across z, evenly spread."""
    angle = np.arange(count) * 2 * np.pi / count
    return list(np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)]))


def _list_ways(*cases: tuple[str, float, str, int]) -> tuple[TroubleWay, ...]:
    """Ways of part, depth in tolerances, `known` or `unknown` pose, and number of scanner positions."""
    return tuple(TroubleWay(part, pose, views, views > 0, amount) for part, amount, pose, views in cases)


WEAR_TROUBLES: dict[str, Trouble] = {
    "wear: one face": Trouble(
        wear_one_face,
        _list_ways(
            ("block", 2, "unknown", 0),
            ("block", 4, "unknown", 8),
            ("gear", 2, "unknown", 0),
            ("lever", 4, "unknown", 0),
            ("ribbed_plate", 1, "unknown", 0),
            ("coupling", 3, "unknown", 8),
            ("plate", 2, "unknown", 0),
            ("cuboid", 3, "unknown", 0),
            ("gear", 1, "known", 8),
        ),
    ),
    "wear: both faces": Trouble(
        wear_both_faces,
        _list_ways(
            ("plate", 2, "unknown", 0),
            ("gear", 2, "unknown", 0),
            ("block", 3, "unknown", 0),
            ("plate", 4, "known", 8),
        ),
    ),
    "wear: wedge": Trouble(
        wear_wedge,
        _list_ways(
            ("block", 2, "unknown", 0),
            ("lever", 4, "unknown", 0),
            ("plate", 3, "unknown", 0),
            ("cuboid", 4, "known", 8),
        ),
    ),
    "wear: half a shaft": Trouble(
        wear_half_shaft,
        _list_ways(
            ("keyed_shaft", 2, "unknown", 0),
            ("shaft", 3, "unknown", 0),
            ("cylinder", 2, "unknown", 0),
            ("keyed_shaft", 4, "known", 8),
        ),
    ),
    "wear: one side of a journal": Trouble(
        wear_journal,
        _list_ways(("keyed_shaft", 1, "unknown", 0), ("shaft", 4, "unknown", 0), ("cylinder", 3, "known", 8)),
    ),
    "wear: bore": Trouble(
        wear_bore,
        _list_ways(
            ("gear", 2, "unknown", 0),
            ("tube", 4, "unknown", 0),
            ("coupling", 3, "unknown", 0),
            ("lever", 1, "unknown", 0),
            ("tube", 2, "known", 8),
        ),
    ),
    "wear: all over": Trouble(
        wear_all_over,
        _list_ways(
            ("cuboid", 2, "unknown", 0),
            ("gear", 2, "unknown", 0),
            ("block", 3, "unknown", 0),
            ("tube", 4, "unknown", 0),
            ("cylinder", 1, "unknown", 0),
            ("plate", 2, "known", 8),
        ),
    ),
}
"""Kinds of wear: what makes each, and its cases."""
