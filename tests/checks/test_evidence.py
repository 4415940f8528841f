"""The scan bears out the true damage and refutes wrong ones, each wrong in its own way."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from manifold3d import Manifold

from damageest.artefacts import Evidence, Solid
from damageest.checks.evidence import weigh_evidence
from damageest.geometry.solids import iou, to_manifold, to_solid
from tests.scenes import TOOLS, Scene, scene


def evidence(case: Scene, damage: Solid) -> Evidence:
    return weigh_evidence(damage, case.of_sites(), case.aligned, case.deviation, case.part, case.tolerance)


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
