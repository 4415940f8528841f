"""The scan bears out the true damage and refutes wrong ones, each wrong in its own way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from manifold3d import Manifold

from damageest.artefacts import DAMAGE, INTACT, Deviation, Evidence, Part, Scan, Solid
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.scan_field import ScanField
from damageest.geometry.solids import iou, to_manifold, to_solid
from damageest.trust.evidence import weigh_evidence
from tests.scenes import TOOLS, Scene, scene


def evidence(case: Scene, damage: Solid) -> Evidence:
    return weigh_evidence(damage, case.of_sites(), case.field)


def middle(body: Manifold) -> list[float]:
    box = np.array(body.bounding_box())
    return ((box[:3] + box[3:]) / 2).tolist()


@pytest.mark.variants(6)
@pytest.mark.parametrize("name", [name for name in TOOLS if name != "two"])
def test_the_true_damage_is_consistent(name: str) -> None:
    case = scene(name)
    found = evidence(case, case.truth)
    assert found.consistent, found.causes
    assert found.ids_residual < case.tolerance
    assert found.intact_points_inside == 0


WRONG: dict[str, Callable[[Manifold, Manifold], Manifold]] = {
    "the other side": lambda part, lost: part - lost,
    "a neighbour swallowed": lambda part, lost: lost + (part ^ Manifold.cube((7, 7, 9), True).translate(middle(lost))),
    "half of it": lambda part, lost: lost.split_by_plane((0.3, 1, 0.2), float(np.dot((0.3, 1, 0.2), middle(lost))))[0],
    "too large": lambda part, lost: (
        part ^ lost.translate([-x for x in middle(lost)]).scale([1.3] * 3).translate(middle(lost))
    ),
    "too small": lambda part, lost: lost.translate([-x for x in middle(lost)]).scale([0.8] * 3).translate(middle(lost)),
    "shifted": lambda part, lost: part ^ lost.translate((0.3, -0.3, 0.3)),
}


@pytest.mark.variants(15)
@pytest.mark.parametrize("name", ["pit", "edge", "deep hole", "worn through", "beside the bore"])
@pytest.mark.parametrize("kind", WRONG)
def test_a_wrong_damage_is_refuted_with_a_reason(name: str, kind: str) -> None:
    case = scene(name)
    wrong = to_solid(WRONG[kind](to_manifold(case.part), to_manifold(case.truth)))
    assert wrong is not None
    assert iou(wrong, case.truth) < 0.93
    found = evidence(case, wrong)
    assert not found.consistent
    assert found.causes


def test_damage_that_goes_on_where_nothing_was_seen_is_doubted() -> None:
    case = scene("pit")
    near = np.linalg.norm(case.aligned.points[:, :2] - [9, 9], axis=1) < 9
    blind = case.without(near & (case.deviation.distance > -case.tolerance))
    found = evidence(blind, case.truth)
    assert found.skin_unseen > 0.9
    assert not found.consistent


@pytest.mark.parametrize(("least_x", "is_seen"), [(-20.0, True), (3.0, False)])
def test_the_other_side_of_a_thin_wall_is_not_beside_a_pit(least_x: float, is_seen: bool) -> None:
    """A pit 8 mm wide in a plate of 1.5 mm, scanned from above: all of its top, or only what is beyond ``least_x``."""
    part = to_solid(Manifold.cube((40, 40, 1.5), True).translate((0, 0, -0.75)))
    damage = to_solid(Manifold.cube((8, 8, 0.6), True).translate((0, 0, -0.3)))
    assert part is not None
    assert damage is not None
    along = np.arange(-19.75, 20, 0.5)
    points = np.stack(np.meshgrid(along, along, [0.0]), axis=-1).reshape(-1, 3)
    in_pit = np.abs(points[:, :2]).max(axis=1) < 4
    points[in_pit, 2] = -0.6
    points = points[in_pit | (points[:, 0] > least_x)]
    in_pit = points[:, 2] < 0
    deviation = Deviation(points[:, 2].copy(), np.zeros(len(points), int), np.where(in_pit, DAMAGE, INTACT))
    plate = Part(part.vertices, part.faces)
    deviation = replace(deviation, face=closest_on_mesh(points * [1, 1, 0], plate).face)
    field = ScanField(plate, Scan(points, noise=0.01, spacing=0.5), deviation, 0.15)
    found = weigh_evidence(damage, points[in_pit], field)
    assert (found.skin_unseen < 0.02) == is_seen
    assert (found.skin_unseen > 0.25) != is_seen
