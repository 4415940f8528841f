"""The box holds part and damage surface, finely enough."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.errors import StageError
from damageest.stages.background.bbox import BoundingBox
from tests.stages.background.holding import box, dent, measure_longest_edge


def test_holds_both_with_the_clearance() -> None:
    part, surface = box(), dent(15)  # reaches above the part
    found = BoundingBox(clearance=3).run(part, surface, 0.5, 0.1, True)
    low = np.minimum(part.bounds[0], surface.bounds[0])
    high = np.maximum(part.bounds[1], surface.bounds[1])
    assert np.allclose(found.bounds, [low - 1.5, high + 1.5])
    assert found.volume == pytest.approx(np.prod(np.ptp(found.bounds, axis=0)))
    assert measure_longest_edge(found) <= 2.0


def test_left_coarse_where_enclose_refines() -> None:
    assert len(BoundingBox().run(box(), dent(), 0.5, 0.1, False).faces) == 12


@pytest.mark.slow
def test_a_tiny_tolerance_does_not_fill_the_memory() -> None:
    assert len(BoundingBox().run(box(), dent(), 1e-4, 1e-3, True).faces) < 500_000


def test_a_sparse_scan_widens_the_clearance() -> None:
    found = BoundingBox().run(box(), dent(), 0.1, 2.0, True)
    assert np.allclose(found.bounds[0], box().bounds[0] - 3.0)


@pytest.mark.parametrize("how", ["linear", "adaptive"])
def test_subdivision_keeps_the_box(how: str) -> None:
    found = BoundingBox.model_validate({"use": "bbox", "subdivide": how}).run(box(), dent(), 0.5, 0.1, True)
    assert measure_longest_edge(found) <= 1.0
    assert found.volume == pytest.approx(np.prod(np.ptp(found.bounds, axis=0)))
    assert np.allclose(found.bounds, [box().bounds[0] - 1, box().bounds[1] + 1])


def test_smoothing_a_box_cuts_its_corners_and_is_refused() -> None:
    with pytest.raises(StageError, match="does not contain") as caught:
        BoundingBox(subdivide="loop").run(box(), dent(), 0.5, 0.1, True)
    assert "subdivide: linear" in caught.value.remedy
