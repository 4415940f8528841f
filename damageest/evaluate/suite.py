"""The built-in suite: random damages on thirteen parts, in unknown pose, through the whole route."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

from damageest.artefacts import Part
from damageest.errors import InputError, suggest
from damageest.evaluate._case import Case
from damageest.evaluate._vary import Base, Wanted, variants
from damageest.evaluate.damages import KINDS
from damageest.evaluate.job import checked, code
from damageest.evaluate.parts import PARTS
from damageest.evaluate.sized import SIZED
from damageest.pipeline.cache import digest
from damageest.registry import Registry

SIGMA = 0.0005
"""Noise of the scan as a share of the part's diagonal."""
DENSITY = 0.4
POINTS = 150_000


@cache
def _part(name: str) -> Part:
    return PARTS[name]()


def cases(count: int, seed: int, parts: Sequence[str], pose: str, wanted: Wanted, registry: Registry) -> list[Case]:
    """``count`` damages that go through the parts in turn, each in every variant. Raises InputError or JobError for a
    part that there is not, or for what cannot be varied so."""
    for name in parts:
        if name not in PARTS:
            raise InputError(f"--parts: no part '{name}'{suggest(name, list(PARTS))}; there are: {', '.join(PARTS)}")
    if count < 1:
        raise InputError(f"--cases: give 1 or more, not {count}")
    made, computed = [], code(registry)
    for number in range(count):
        part = _part(parts[number % len(parts)])
        noise = float(f"{SIGMA * part.diagonal:.6g}")
        scanner = {"points": POINTS, "noise": noise, "density": DENSITY, "pose": pose}
        ways = variants(wanted, Base("mm", scanner, 4 * noise, False, True))
        if number == 0:
            for way in ways:
                checked({"version": 1}, way, part, registry)
        for way in ways:
            # the first loss goes through the kinds in turn, shifted for each round of the parts
            kinds = SIZED if way.size else tuple(KINDS)
            first = kinds[(number + number // len(PARTS)) % len(kinds)]
            made.append(
                Case(
                    part=parts[number % len(parts)],
                    seed=1000 * seed + number,
                    first=first,
                    tolerance=way.tolerance,
                    size=way.size,
                    scanner=way.scanner,
                    settings=way.settings,
                    varied=way.varied,
                    source=digest(computed, part.vertices, part.faces),
                )
            )
    return made
