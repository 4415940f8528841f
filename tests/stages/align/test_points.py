"""Picked pairs of points: the pose from them, and pairs that contradict each other."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from align_scenes import error, scene
from pydantic import ValidationError

from damageest.artefacts import Part, Scan
from damageest.errors import StageError
from damageest.stages.align.points import Points


def pick(part: Part, scan: Scan, count: int, off: float) -> list[list[list[float]]]:
    """Pairs of corners of the part, with the point in the scan wrong by ``off`` in a random direction."""
    assert scan.truth is not None
    rng = np.random.default_rng(0)
    low, high = part.bounds
    corners = np.array([low, [high[0], low[1], low[2]], [low[0], high[1], low[2]], high, (low + high) / 2])[:count]
    wrong = rng.normal(size=(count, 3))
    T = np.linalg.inv(scan.truth.T_part_scan)
    seen = corners @ T[:3, :3].T + T[:3, 3] + off * wrong / np.linalg.norm(wrong, axis=1, keepdims=True)
    return [[a.tolist(), b.tolist()] for a, b in zip(seen, corners, strict=True)]


@pytest.mark.variants(1)
@pytest.mark.parametrize("count", [3, 5])
def test_rough_pairs_are_enough(count: int) -> None:
    part, scan = scene("block", seed=1, missing=0.2)
    pose = Points(pairs=pick(part, scan, count, 1.0)).run(scan, part, 4 * scan.noise)  # type: ignore[arg-type]
    assert error(part, pose.T_part_scan, scan) < 0.5
    assert not pose.doubts


def test_the_wrong_pair_is_named() -> None:
    part, scan = scene("block", seed=1)
    pairs = pick(part, scan, 5, 0.2)
    pairs[3][0][0] += 30
    with pytest.raises(StageError, match="without pair 4 the others agree") as caught:
        Points(pairs=pairs).run(scan, part, 4 * scan.noise)  # type: ignore[arg-type]
    assert "pick pair 4 again" in caught.value.remedy


def test_three_pairs_that_contradict_each_other() -> None:
    part, scan = scene("block", seed=1)
    pairs = pick(part, scan, 3, 0.2)
    pairs[2][0][0] += 50
    with pytest.raises(StageError, match=r"contradict each other.*\(pair 3\)"):
        Points(pairs=pairs).run(scan, part, 4 * scan.noise)  # type: ignore[arg-type]


LINE: list[Any] = [[[k, 2 * k, 0], [k, 0, 0]] for k in range(4)]


@pytest.mark.parametrize(("pairs", "text"), [(LINE, "on one line"), (LINE[:2], "at least 3")])
def test_pairs_that_fix_no_pose(pairs: list[Any], text: str) -> None:
    with pytest.raises(ValidationError, match=text):
        Points.model_validate({"pairs": pairs})
