"""A note about points of the scan says where they are."""

from __future__ import annotations

import numpy as np
import pytest

import damageest
from damageest.artefacts import Scan
from tests.sparse_scenes import as_part, block, pocket, scan


def test_a_speck_has_a_place_in_the_parts_frame() -> None:
    points = scan(block() - pocket(2.0))
    stray = np.array([-10.0, -5.0, 2.6]) + np.random.default_rng(0).uniform(-0.15, 0.15, (9, 3))
    shift = np.array([3.0, 0, 0])
    job = {"version": 1, "tolerance": 0.3, "align": {"use": "icp"}, "sites": {}}
    result = damageest.run(job, part=as_part(block()), scan=Scan(np.concatenate([points, stray]) + 0.01 * shift))
    (speck,) = [note for note in result.warnings if note.code == "speck"]
    assert speck.place == pytest.approx((-10, -5, 2.6), abs=0.3)
