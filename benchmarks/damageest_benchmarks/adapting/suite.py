"""The cases: which part is deformed how, and what is lost."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from damageest_benchmarks.adapting.case import TOLERANCE, DeformedCase
from damageest_benchmarks.parts import PARTS

USES = ("straight", "none", "auto", "plain", "drift")
"""What is compared: a part that is not deformed, rigid, the stage, a plain non-rigid fit, and coherent point drift."""
GROUPS = ("damaged", "lost end", "seen in part", "large loss", "whole", "worn")
SHAPES = (
    "blade", "lever", "ribbed_plate", "keyed_shaft", "gear", "coupling", "tube", "block", "half_torus", "grille",
)  # fmt: skip
DEFORMED: Sequence[Mapping[str, float]] = (
    {"bend": 10}, {"bend": 3}, {"twist": 3}, {"twist": 8}, {"scale": 3}, {"scale": -3}, {"taper": 3}, {"stretch": 2},
    {"free": 2, "cells": 1}, {"free": 4, "cells": 2}, {"bend": 5, "twist": 3}, {"bend": 1},
)  # fmt: skip
"""How parts are deformed; amounts in tolerances."""


def make_adapting_cases(groups: Sequence[str], names: str, points: int, source: str) -> list[DeformedCase]:
    """The cases of the groups, all of them if none is given, whose name has ``names`` in it; one for each of `USES`."""
    plain = [case for case in _make_all(points, source) if not groups or case.group in groups]
    return [case.adapted_by(use) for case in plain if names in case.name for use in USES]


def _make_all(points: int, source: str) -> Iterator[DeformedCase]:
    def make(group: str, part: str, deform: Mapping[str, float], seed: int, **more: Any) -> DeformedCase:
        how = " ".join(f"{kind} {amount:g}" for kind, amount in deform.items() if kind not in ("cells", "seed"))
        name = f"{part.replace('_', ' ')}, {how or 'as designed'}{more.pop('told', '')}"
        amounts = {kind: v if kind in ("cells", "seed") else v * TOLERANCE for kind, v in deform.items()}
        return DeformedCase(group, name, part, amounts, seed=seed, points=points, source=source, **more)

    for number in range(9 * len(SHAPES)):  # 90; each part meets nine deformations, and one to three losses
        part, kind = SHAPES[number % len(SHAPES)], DEFORMED[(number + number // len(SHAPES)) % len(DEFORMED)]
        losses = [(4.0, 6.0, 3.0)[(number + k) % 3] for k in range(1 + number % 3)]
        yield make("damaged", part, {**kind, **_seed(kind, number)}, number, losses=losses)
    for number, (part, share) in enumerate((p, s) for p in ("blade", "lever", "keyed_shaft") for s in (0.05, 0.1)):
        for kind in ({"bend": 5}, {"twist": 3}):
            yield make("lost end", part, kind, number, wear=[cut_end(part, share)], told=f", {share:.0%} of its end")
    for number, part in enumerate(("blade", "lever", "block", "ribbed_plate", "coupling", "tube")):
        yield make("seen in part", part, {"bend": 5}, number, losses=[5.0], seen=1 / 3, told=", a third seen")
        yield make("large loss", part, {"bend": 5}, number, wear=[cut_end(part, 0.125)], told=", an eighth lost")
    for number in range(20):
        part, kind = SHAPES[number % len(SHAPES)], DEFORMED[(5 * number) % len(DEFORMED)]
        yield make("whole", part, {**kind, **_seed(kind, number)}, number)
    for number, (part, told, tool) in enumerate(_make_worn()):
        for kind in ({}, {"bend": 5}):
            yield make("worn", part, kind, number, wear=[tool], told=told)


def _seed(kind: Mapping[str, float], number: int) -> dict[str, float]:
    return {"seed": number} if "free" in kind else {}


def cut_end(part: str, share: float) -> dict[str, Any]:
    """A plane across the longest edge of the box, that takes this share of its length off."""
    low, high = PARTS[part]().bounds
    axis = int((high - low).argmax())
    point, normal = ((low + high) / 2).tolist(), [0.0, 0.0, 0.0]
    point[axis] = float(high[axis] - share * (high - low)[axis])
    normal[axis] = 1.0
    return {"tool": "plane", "point": point, "normal": normal}


def _make_worn() -> Iterator[tuple[str, str, dict[str, Any]]]:
    for part, radius in (("gear", 10.0), ("coupling", 11.0), ("lever", 8.0)):
        for depth, shift in ((2.0, 0.0), (1.5, 1.5)):
            rod = {"tool": "cylinder", "point": [shift * TOLERANCE, 0, -200], "axis": [0, 0, 1], "length": 400}
            told = ", its bore oval" if shift else ", its bore worn"
            yield part, told, {**rod, "radius": radius + depth * TOLERANCE}
    for part in ("block", "lever", "half_torus", "coupling"):
        top = float(PARTS[part]().bounds[1][2])
        plane = {"tool": "plane", "point": [0, 0, top - 2 * TOLERANCE], "normal": [0, 0, 1]}
        yield part, ", its top worn", plane
