"""The nozzle along a path on which it turns: few poses stand for all, and decide as each of them does."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.clearance.obstacles import Obstacles
from damageest_paths.holding.sweeps import Sweeps
from damageest_paths.tool.nozzle import Cone, make_nozzle
from damageest_paths.tool.sight import Beam

from damageest.artefacts import Flags, Floats, Mesh
from damageest.geometry.vectors import normalise

LOW, HIGH = np.array([-5.0, -5, -5]), np.array([25.0, 5, 0])
NEEDED = 0.5


def make_clearance(*boxes: tuple[tuple[float, float, float], tuple[float, float, float]]) -> Clearance:
    """A nozzle among boxes, each of a size and a middle."""
    meshes = [trimesh.creation.box(size).apply_translation(middle) for size, middle in boxes]
    obstacles = Obstacles([Mesh(np.asarray(m.vertices), np.asarray(m.faces, np.int64)) for m in meshes], LOW, HIGH, 2.0)
    return Clearance(make_nozzle(Cone(1.0, 4.0, 30.0, np.radians(20))), 3.0, obstacles)


def make_path(seed: int, count: int = 600) -> tuple[Floats, Floats]:
    """Points along x and back, and axes that swing to and fro by up to 40 degrees."""
    rng = np.random.default_rng(seed)
    share = np.linspace(0, 1, count)
    points = np.column_stack([20 * np.sin(np.pi * share), 3 * share, np.zeros(count)])
    tilt = np.radians(rng.uniform(10, 40)) * np.sin(rng.uniform(2, 9) * share + rng.uniform(0, 6))
    turn = rng.uniform(0, 6) + rng.uniform(-4, 4) * share
    axes = np.column_stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])
    return points, normalise(axes)


def measure_each(clearance: Clearance, points: Floats, axes: Floats) -> Floats:
    return np.array([clearance.measure(*pose) for pose in zip(points, axes, strict=True)])


@pytest.mark.parametrize("jumps", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_a_path_is_free_where_each_pose_is(seed: int, jumps: bool) -> None:
    """With ``jumps``, pieces of the path are left out, so that poses far from each other follow each other."""
    clearance = make_clearance(((40, 40, 4), (10, 0, -3)), ((2, 2, 12), (9, 3, 5)), ((3, 1, 6), (15, -4, 6)))
    points, axes = make_path(seed)
    if jumps:
        kept = np.arange(600) // 40 % 3 > 0
        points, axes = points[kept], axes[kept]
    found, exact = Sweeps(clearance).measure_poses(points, axes, NEEDED), measure_each(clearance, points, axes)
    assert 0.05 < (exact < NEEDED).mean() < 0.95
    # the nozzle's mesh is within the solid of revolution by 0.5 % of its radius
    assert (exact[found >= NEEDED] >= NEEDED - 0.03).all()
    assert (found[exact > 1.1 * NEEDED + 0.03] >= NEEDED).all()


def find_shaded_each(clearance: Clearance, points: Floats, axes: Floats) -> Flags:
    assert clearance.beam is not None
    least = np.min([measure_each(each, points, axes) for each in clearance.beams], axis=0)
    return np.asarray(least < clearance.beam.needed)


@pytest.mark.parametrize("width", [3.0, 0.1])
def test_the_beam_meets_what_it_would_meet_at_each_pose(width: float) -> None:
    """A post that it passes through, and a wire that is much thinner than the way between two poses looked at."""
    beam = Beam(1.0, 0.0, np.radians(60))
    clearance = make_clearance(((width, width, 4), (12, 1, 3)))
    points, axes = make_path(1)
    clearance = Clearance(clearance.nozzle, 6.0, clearance.obstacles, beam=beam)
    shaded, true = clearance.find_shaded(points, axes), find_shaded_each(clearance, points, axes)
    assert 0.02 < true.mean() < 0.9
    assert (shaded != true).mean() < 0.01
    thinner = Clearance(clearance.nozzle, 6.0, clearance.obstacles, beam=Beam(0.95, 0.0, np.radians(60)))
    assert shaded[find_shaded_each(thinner, points, axes)].all()
