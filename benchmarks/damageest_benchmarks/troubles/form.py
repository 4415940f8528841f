"""Troubles of form: a part that is bent, twisted or of another size, with and without damage; views that disagree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import Floats, Mesh, Solid
from damageest.stages.scan.deformation import Deformation, deform
from damageest_benchmarks.troubles.scanner import make_wavy
from damageest_benchmarks.troubles.scene import Scanning, TroubleScene
from damageest_benchmarks.troubles.shape import scale_scan, scale_scene
from damageest_benchmarks.troubles.ways import Trouble, TroubleWay


def scale_damaged(case: Scanning) -> TroubleScene:
    """As `scale_scan`, with a chip."""
    return scale_scene(case, *case.damage("chip"))


def bend(case: Scanning) -> TroubleScene:
    """The undamaged part is bent by ``amount`` tolerances."""
    return _deform(case, case.part, None, Deformation(bend=case.amount * case.tolerance))


def twist(case: Scanning) -> TroubleScene:
    """The undamaged part is twisted by ``amount`` tolerances."""
    return _deform(case, case.part, None, Deformation(twist=case.amount * case.tolerance))


def bend_chipped(case: Scanning) -> TroubleScene:
    """The part has a chip, and is bent by ``amount`` tolerances."""
    return _deform(case, *case.damage("chip"), Deformation(bend=case.amount * case.tolerance))


def _deform(case: Scanning, left: Mesh, damage: Solid | None, how: Deformation) -> TroubleScene:
    exact = case.scan(left, damage, noise=0)

    def move(at: Floats) -> Floats:
        return deform(at, how, case.part)

    noise = case.make_rng(12).normal(scale=case.noise, size=exact.points.shape)
    return replace(exact, points=move(exact.points) + noise, deform=move)


def misplace_and_dent(case: Scanning) -> TroubleScene:
    """The second view of a part with a pit is ``amount`` tolerances away from where it belongs, and turned a little."""
    from scipy.spatial.transform import Rotation

    scene = case.scan(*case.damage("pit"))
    assert scene.view is not None
    assert scene.scanners is not None
    rng = case.make_rng(6)
    shift, axis = rng.normal(size=(2, 3))
    shift *= case.amount * case.tolerance / np.linalg.norm(shift)
    turn = Rotation.from_rotvec(axis / np.linalg.norm(axis) * case.amount * case.tolerance / case.part.diagonal)
    centre = case.part.bounds.mean(axis=0)

    def move(at: Floats) -> Floats:
        return np.asarray(turn.apply(at - centre) + centre + shift)

    own = scene.view == 1
    points, scanners = scene.points.copy(), scene.scanners.copy()
    points[own], scanners[1] = move(points[own]), move(scanners[1:2])[0]
    return replace(scene, points=points, scanners=scanners)


FORM_TROUBLES: dict[str, Trouble] = {
    "form: scaled": Trouble(
        scale_scan,
        (
            TroubleWay("plate", "unknown", 8, amount=0.998),
            TroubleWay("coupling", "known", 0, False, 1.002),
            TroubleWay("keyed_shaft", "unknown", 0, False, 1.01),
            TroubleWay("rib_bracket", "known", 8, amount=0.99),
            TroubleWay("grille", "unknown", 0, False, 0.98),
        ),
    ),
    "form: scaled, with a chip": Trouble(
        scale_damaged,
        (
            TroubleWay("block", "unknown", 0, False, 1.005),
            TroubleWay("lever", "known", 8, amount=0.995),
            TroubleWay("ribbed_plate", "unknown", 8, amount=1.003),
            TroubleWay("gear", "unknown", 0, False, 0.99),
        ),
    ),
    "form: bent": Trouble(
        bend,
        (
            TroubleWay("plate", "unknown", 0, False, 1.0),
            TroubleWay("lever", "unknown", 8, amount=3.0),
            TroubleWay("blade", "known", 0, False, 1.0),
            TroubleWay("ribbed_plate", "unknown", 0, False, 6.0),
            TroubleWay("shaft", "unknown", 8, amount=2.0),
            TroubleWay("keyed_shaft", "known", 8, amount=1.0),
        ),
    ),
    "form: twisted": Trouble(
        twist,
        (
            TroubleWay("blade", "unknown", 0, False, 3.0),
            TroubleWay("plate", "known", 8, amount=1.5),
            TroubleWay("rib_bracket", "unknown", 8, amount=2.0),
            TroubleWay("lever", "unknown", 0, False, 5.0),
            TroubleWay("block", "known", 0, False, 1.0),
        ),
    ),
    "form: bent, with a chip": Trouble(
        bend_chipped,
        (
            TroubleWay("blade", "unknown", 0, False, 1.5),
            TroubleWay("plate", "unknown", 8, amount=2.0),
            TroubleWay("lever", "known", 0, False, 1.0),
            TroubleWay("ribbed_plate", "unknown", 8, amount=4.0),
        ),
    ),
    "form: view misplaced, with a pit": Trouble(
        misplace_and_dent,
        (
            TroubleWay("block", "unknown", 8, amount=3.0),
            TroubleWay("lever", "unknown", 3, amount=5.0),
            TroubleWay("rib_bracket", "unknown", 8, amount=2.0),
            TroubleWay("gear", "known", 8, amount=3.0),
            TroubleWay("cuboid", "unknown", 2, amount=4.0),
        ),
    ),
    "form: wavy": Trouble(
        make_wavy,
        (
            TroubleWay("plate", "unknown", 8, amount=1.5),
            TroubleWay("coupling", "known", 0, False, 1.0),
            TroubleWay("lever", "unknown", 0, False, 2.0),
        ),
    ),
}
"""As `TROUBLES`: what makes a kind, and its cases. Amounts of bending and twisting are those of
`Deformation`, in tolerances."""
