"""A note about points of the scan says where they are."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.artefacts import Scan
from damageest.registry import Registry
from tests.pipeline.halfway import run_until
from tests.sparse_scenes import as_part, block, pocket, scan


@pytest.mark.slow
def test_a_speck_has_a_place_in_the_parts_frame(registry: Registry) -> None:
    points = scan(block() - pocket(2.0))
    stray = np.array([-10.0, -5.0, 2.6]) + np.random.default_rng(0).uniform(-0.15, 0.15, (9, 3))
    shift = np.array([3.0, 0, 0])
    moved, back = Scan(np.concatenate([points, stray]) + shift), np.eye(4)
    back[:3, 3] = -shift
    known = {"use": "none", "T_part_scan": back.tolist()}
    found = run_until("choose_sites", as_part(block()), moved, registry, tolerance=0.3, align=known)
    (speck,) = [note for note in found.state.warnings if note.code == "speck"]
    assert speck.place == pytest.approx((-10, -5, 2.6), abs=0.3)
