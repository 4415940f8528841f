"""The grid over the build volume: the same for every part, and made round the site only."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Floats, Part, Samples, Solid
from damageest.errors import StageError
from damageest.stages.background.build_volume import BuildVolume
from damageest.stages.sample.edge_aware import EdgeAware
from tests.stages.background.holding import box, dent

TOLERANCE, SPACING = 0.3, 0.3
SIZE = (200.0, 200.0, 100.0)


def scene(part: Part, lost: float = 6.0) -> tuple[Samples, Floats]:
    """CAD points, and intact points, of which the top has none within ``lost`` of the z axis."""
    points, _ = trimesh.sample.sample_surface(trimesh.Trimesh(part.vertices, part.faces), 40_000, seed=1)
    gone = (np.hypot(points[:, 0], points[:, 1]) < lost) & (points[:, 2] > 9)
    return EdgeAware().run(part, 2 * TOLERANCE), np.asarray(points[~gone])


def make_background(stage: BuildVolume, part: Part, lost: float = 6.0) -> Solid:
    samples, intact = scene(part, lost)
    return stage.run(part, dent(), samples, intact, TOLERANCE, SPACING)


def test_only_the_cells_round_the_site_are_made() -> None:
    part = box((80, 60, 20))
    found = make_background(BuildVolume(size=SIZE), part)
    assert found.bounds[0, 0] > -12
    assert found.bounds[1, 0] < 12
    assert found.bounds[1, 2] > 10 + 1.5 * TOLERANCE
    whole = 200 * 200 * 100 / (2 * TOLERANCE) ** 3
    assert len(found.vertices) < whole / 1000


def test_all_lost_skin_is_inside() -> None:
    """Also where the skin is lost far beyond the damage surface."""
    part = box((80, 60, 20))
    near, far = make_background(BuildVolume(size=SIZE), part), make_background(BuildVolume(size=SIZE), part, lost=20)
    assert far.bounds[1, 0] > 20
    assert near.bounds[1, 0] < 12


def test_vertices_lie_on_the_grid_of_the_build_volume() -> None:
    """For any part: each vertex is on a line of the grid, two of its coordinates are multiples of the cell."""
    for size in [(80, 60, 20), (60, 70, 20)]:
        found = make_background(BuildVolume(size=SIZE, corner=(-100, -100, -50), cell=0.5), box(size))
        steps = found.vertices / 0.5
        on = np.abs(steps - np.round(steps)) < 1e-4
        assert (on.sum(axis=1) >= 2).all()


def test_a_part_that_does_not_fit_in_is_refused() -> None:
    with pytest.raises(StageError, match=r"does not fit into the build volume: it sticks out by .* in x") as caught:
        make_background(BuildVolume(size=(81, 100, 100)), box((80, 60, 20)))
    assert "corner" in caught.value.remedy


def test_too_many_cells_are_refused_before_they_are_made() -> None:
    with pytest.raises(StageError, match="does not fit in memory") as caught:
        make_background(BuildVolume(size=SIZE, cell=0.02), box((80, 60, 20)))
    assert "a cell of" in caught.value.remedy
