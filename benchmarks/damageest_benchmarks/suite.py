"""The built-in suite: random damages on thirteen parts, in unknown pose, through the whole route."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

from damageest_evaluate.case import DamageCase
from damageest_evaluate.damages import KINDS
from damageest_evaluate.job import check_variant, fingerprint_code
from damageest_evaluate.sized import SIZED
from damageest_evaluate.variants import Baseline, VariationRequest, make_variants

from damageest.artefacts import Part
from damageest.errors import InputError, suggest
from damageest.io.digests import digest
from damageest.registry import Registry
from damageest_benchmarks.built_in import BuiltInCase
from damageest_benchmarks.parts import PARTS

SIGMA = 0.0005
"""Noise of the scan, as a share of the part's diagonal."""
DENSITY = 0.4
"""Unevenness of the scan's density: the option `density` of `scan: simulate`."""
POINTS = 150_000
"""Points of the scan."""


@cache
def _make_part(name: str) -> Part:
    return PARTS[name]()


def make_cases(
    count: int, seed: int, parts: Sequence[str], pose: str, request: VariationRequest, registry: Registry
) -> list[DamageCase]:
    """The cases: ``count`` random damages, on each of the parts in turn, and each in all variants.

    Raises InputError or JobError for an unknown part or an invalid variation.
    """
    for name in parts:
        if name not in PARTS:
            raise InputError(
                f"--parts: there is no part '{name}'{suggest(name, list(PARTS))}; there are: {', '.join(PARTS)}"
            )
    if count < 1:
        raise InputError(f"--cases: {count} is too few; at least 1 is needed")
    cases: list[DamageCase] = []
    code = fingerprint_code(registry)
    for number in range(count):
        part = _make_part(parts[number % len(parts)])
        noise = float(f"{SIGMA * part.diagonal:.6g}")
        scanner = {"points": POINTS, "noise": noise, "density": DENSITY, "pose": pose}
        ways = make_variants(request, Baseline("mm", scanner, 4 * noise, False, True))
        if number == 0:
            for way in ways:
                check_variant({"version": 1}, way, part, registry)
        for way in ways:
            # the first damage is of each kind in turn, with another kind in each round of the parts
            kinds = SIZED if way.size else tuple(KINDS)
            first = kinds[(number + number // len(PARTS)) % len(kinds)]
            cases.append(
                BuiltInCase(
                    part=parts[number % len(parts)],
                    seed=1000 * seed + number,
                    first=first,
                    tolerance=way.tolerance,
                    size=way.size,
                    scanner=way.scanner,
                    settings=way.settings,
                    varied=way.varied,
                    source=digest(code, part.vertices, part.faces),
                )
            )
    return cases
