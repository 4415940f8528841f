"""How exactly the model fit names scale, bending and twisting, and whether it names them where there are none.

``python -m damageest_benchmarks.forms`` prints the table of forms in benchmarks/results/troubles.md; ``--clean 208``
runs the cases of
`damageest evaluate suite` instead, which are not deformed. Both scan in a pose that is off by a part of a tolerance;
``--register`` finds it with `align: register`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from damageest_evaluate.case import simulate_scan
from damageest_evaluate.variants import VariationRequest

from damageest.artefacts import Part, Scan
from damageest.errors import StageError
from damageest.findings import ModelFit
from damageest.geometry.distance import signed_distance
from damageest.geometry.noise import measure_noise_and_spacing
from damageest.geometry.transforms import move_points
from damageest.registry import Registry
from damageest.stages.align.register import Register
from damageest.stages.scan.simulate import Simulate
from damageest.trust.model_fit import measure_fit
from damageest_benchmarks.parts import PARTS
from damageest_benchmarks.suite import make_cases
from damageest_benchmarks.troubles.parts import NOISE, TOLERANCE, make_named_part

SHAPES = ("plate", "blade", "lever", "ribbed_plate", "keyed_shaft", "rib_bracket")
SCALES = (0.98, 0.995, 0.999, 1.001, 1.005, 1.02)
AMOUNTS = (1.0, 3.0, 10.0)
POINTS = 50_000


@dataclass(frozen=True)
class FormCase:
    """One scan: the ``part``, the ``kind`` `scale`, `bend` or `twist`, and its ``amount``: a factor, or tolerances."""

    part: str
    kind: str
    amount: float


def make_form_cases() -> list[FormCase]:
    """Each kind in each amount on each part."""
    ways = [("scale", amount) for amount in SCALES]
    ways += [(kind, amount) for kind in ("bend", "twist") for amount in AMOUNTS]
    return [FormCase(part, kind, amount) for kind, amount in ways for part in SHAPES]


def fit_scan(part: Part, scan: Scan, tolerance: float, is_registered: bool, seed: int) -> ModelFit | None:
    """The model fit of a scan in the part's frame, which is off by a part of a tolerance."""
    shift = np.random.default_rng(seed).normal(size=3)
    points = scan.points + 0.3 * tolerance * shift / np.linalg.norm(shift)
    noise, spacing = measure_noise_and_spacing(points)
    if is_registered:
        pose = Register().run(Scan(points, noise=noise, spacing=spacing), part, tolerance).T_part_scan
        points = move_points(points, pose)
    found = measure_fit(part, points, signed_distance(points, part)[0], noise, tolerance, part.unit, None)
    return None if found is None else found.fit


def run_case(case: FormCase, is_registered: bool) -> str:
    """A row of the table."""
    part = make_named_part(case.part)
    noise = NOISE * part.diagonal
    tolerance = TOLERANCE * noise
    option = {"scale": case.amount} if case.kind == "scale" else {"deform": {case.kind: case.amount * tolerance}}
    scan = Simulate.model_validate({"points": POINTS, "noise": noise, **option}).run(part.unit, part)
    try:
        fit = fit_scan(part, scan, tolerance, is_registered, 1)
    except StageError as error:
        return f"| {case.part} | {case.kind} {case.amount:g} | refused: {error} | | |"
    assert fit is not None
    if case.kind == "scale":
        off = f"{100 * (fit.scale - case.amount):+.3f} %"
        found = f"{fit.scale:.5f}"
    else:
        off = f"{fit.amount / (case.amount * tolerance) - 1:+.1%}"
        found = ", ".join(f"{kind} {amount / tolerance:.2f}" for kind, amount in fit.deformation) or "none"
    return f"| {case.part} | {case.kind} {case.amount:g} | {fit.model} | {found} | {off} |"


def run_clean(count: int, first: int, is_registered: bool) -> Iterator[str]:
    """A line for each case of the suite, which is not deformed."""
    cases = make_cases(count, 0, list(PARTS), "identity", VariationRequest(), Registry.discover())
    for number, case in enumerate(cases[first:], first):
        part, thin = case.load_part(), replace(case, scanner={**case.scanner, "points": POINTS})
        try:
            scan, kinds = simulate_scan(thin, part)
        except LookupError:
            continue
        fit = fit_scan(part, scan, case.tolerance, is_registered, number)
        yield f"{number} {case.part} {' '.join(kinds)}: {'no fit' if fit is None else fit.model}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clean", type=int, default=0, help="number of cases of the suite")
    parser.add_argument("--first", type=int, default=0, help="number of the first of them")
    parser.add_argument("--register", action="store_true", help="find the pose with align: register")
    parser.add_argument("--only", default="", help="kinds, as bend,twist")
    parser.add_argument("--parts", default="", help="names of parts")
    given = parser.parse_args()
    if given.clean:
        for line in run_clean(given.clean, given.first, given.register):
            print(line, flush=True)
        return
    print("| part | done | model | found | error |\n| --- | --- | --- | --- | --- |")
    for case in make_form_cases():
        if (not given.only or case.kind in given.only.split(",")) and (
            not given.parts or case.part in given.parts.split(",")
        ):
            print(run_case(case, given.register), flush=True)


if __name__ == "__main__":
    main()
