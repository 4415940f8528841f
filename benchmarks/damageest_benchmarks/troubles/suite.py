"""The cases of the suite: each kind of trouble on several parts, in known and unknown pose."""

from __future__ import annotations

from collections.abc import Sequence

from damageest.errors import InputError, suggest
from damageest_benchmarks.troubles.case import TroubleCase
from damageest_benchmarks.troubles.kinds import TROUBLES
from damageest_benchmarks.troubles.parts import NAMES

POINTS = 50_000
"""Points of a scan."""


def make_trouble_cases(
    kinds: Sequence[str] = (),
    parts: Sequence[str] = (),
    seeds: Sequence[int] = (0,),
    points: int = POINTS,
    numbers: Sequence[int] = (),
    source: str = "",
) -> list[TroubleCase]:
    """The cases of the given kinds, parts and numbers (none given: all), each with every seed.

    A kind's name may be shortened to its beginning. Raises InputError for an unknown kind or part, and if no case is
    left.
    """
    chosen = choose_names("--kinds", kinds, tuple(TROUBLES))
    names = choose_names("--parts", parts, NAMES)
    cases, number = [], 0
    for kind, trouble in TROUBLES.items():
        for way in trouble.ways:
            number += 1
            if kind not in chosen or way.part not in names or (numbers and number not in numbers):
                continue
            cases += [
                TroubleCase(kind=kind, seed=seed, number=number, points=points, source=source, **vars(way))
                for seed in seeds
            ]
    if not cases:
        raise InputError("no case has these kinds, parts and numbers; leave out --kinds, --parts or --case")
    return cases


def choose_names(option: str, given: Sequence[str], known: Sequence[str]) -> tuple[str, ...]:
    """The names that are given, each in full or as the beginning of one or more names; all if none is given."""
    found: list[str] = []
    for word in given:
        matches = [word] if word in known else [name for name in known if name.startswith(word)]
        if not matches:
            raise InputError(
                f"{option}: '{word}' is unknown{suggest(word, list(known))}; there are: {', '.join(known)}"
            )
        found += matches
    return tuple(found) if given else tuple(known)
