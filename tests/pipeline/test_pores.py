"""A pore inside the metal, as tomography shows it, is lost metal that nothing can be deposited in."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import damageest
from damageest.trust.interval.site_error import combine_total
from tests.geometry.shapes import ball, box
from tests.scenes import spread
from tests.trust.errors import make_error

RADIUS, NOISE = 2.0, 0.02


def scan_with_pore(at: tuple[float, float, float]) -> np.ndarray:
    """Points all over a box of 30 x 24 x 20, and of a ball in it."""
    rng = np.random.default_rng(2)
    skin, normals = spread(box((30, 24, 20)), 9000, rng)
    pore, outward = spread(ball(RADIUS, at), 260, rng)
    points, normals = np.concatenate([skin, pore]), np.concatenate([normals, -outward])
    return points + NOISE * rng.normal(size=len(points))[:, None] * normals


@pytest.mark.slow
def test_a_pore_is_a_site_of_its_own_and_in_no_deposit() -> None:
    part = trimesh.creation.box((30, 24, 20))
    job = {"version": 1, "units": "mm", "tolerance": 0.15, "align": "none", "allowance": {"use": "milling", "outer": 1}}
    result = damageest.run(job, part=part, scan=scan_with_pore((3, 2, 1)))
    (site,) = result.sites
    assert (site.method, site.accepted, result.failures) == ("pore", True, ())
    true = 4 / 3 * np.pi * RADIUS**3
    low, high = result.volume_95
    assert low <= true <= high
    assert site.damage.volume == pytest.approx(true, rel=0.1)
    with pytest.raises(ValueError, match="no deposit"):
        site.mesh("deposit")
    assert any("a closed pore" in str(note) for note in site.warnings)


def test_a_volume_that_no_pose_moves_adds_to_one_that_a_pose_moves() -> None:
    moved = make_error(100.0, noise=1.0, pose=np.array([3.0, 0.0]))
    still = make_error(50.0)
    alone, together = combine_total(100.0, [moved]), combine_total(150.0, [moved, still])
    assert np.subtract(together, alone) == pytest.approx([50.0, 50.0])
