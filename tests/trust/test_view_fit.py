"""Views that disagree are found, and put right where their points fix their pose."""

from __future__ import annotations

import numpy as np
import pytest
from damageest_benchmarks.parts import PARTS
from scipy.spatial.transform import Rotation

import damageest
from damageest.artefacts import Scan
from damageest.geometry.noise import measure_noise_and_spacing
from damageest.stages.scan.simulate import Simulate
from damageest.trust.views.view_fit import fit_views
from tests.trust.form_scenes import NOISE, TOLERANCE, add_noise, draw_skin, get_part

SCANNERS = 200.0 * np.array([(1, 1, 1), (-1, -1, 1), (1, -1, -1), (-1, 1, -1), (-1, 1, 1), (1, 1, -1)])


def make_scan(move: np.ndarray, chosen: int = 1, count: int = 24_000) -> Scan:
    points, normals = draw_skin("rib_bracket", count)
    facing = normals @ SCANNERS.T > 0.1
    view = np.argmax(facing * np.random.default_rng(5).random(facing.shape), axis=1).astype(np.int32)
    moved = points @ move[:3, :3].T + move[:3, 3]
    points = add_noise(np.where((view == chosen)[:, None], moved, points))
    return Scan(points, noise=NOISE, spacing=0.8, viewpoints=SCANNERS, view=view)


def make_motion(shift: float, turn: float) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(np.radians(turn) * np.array([0.6, 0, 0.8])).as_matrix()
    T[:3, 3] = shift * np.array([0.48, 0.6, 0.64])
    return T


def test_views_that_agree_are_left_alone() -> None:
    found = fit_views(get_part("rib_bracket"), make_scan(np.eye(4)), TOLERANCE, True)
    assert found is not None
    assert not found.disagree
    assert found.views == ()


@pytest.mark.slow
def test_a_misplaced_view_is_named_and_put_right() -> None:
    part, true = get_part("rib_bracket"), make_motion(0.8, 0.3)
    scan = make_scan(true)
    found = fit_views(part, scan, TOLERANCE, True)
    assert found is not None
    assert found.disagree
    assert [view.number for view in found.views if view.is_corrected] == [1]
    own = scan.view == 1
    right = found.apply(scan).points[own]
    clean = (scan.points[own] - true[:3, 3]) @ true[:3, :3]
    assert np.linalg.norm(right - clean, axis=1).max() < 0.2 * TOLERANCE
    inverse = np.linalg.inv(true)
    centre = part.bounds.mean(axis=0)
    shift = inverse[:3, :3] @ centre + inverse[:3, 3] - centre
    assert found.views[1].shift == pytest.approx(shift, abs=0.2 * TOLERANCE)
    assert found.views[1].turn == pytest.approx(0.3, abs=0.1)


@pytest.mark.slow
def test_a_view_is_named_only_where_it_is_not_to_be_corrected() -> None:
    found = fit_views(get_part("rib_bracket"), make_scan(make_motion(0.8, 0)), TOLERANCE, False)
    assert found is not None
    assert found.disagree
    assert not any(view.is_corrected for view in found.views)


def test_a_bent_part_is_no_misplaced_view() -> None:
    from dataclasses import replace

    from damageest.stages.scan.deformation import Deformation, deform

    scan, part = make_scan(np.eye(4)), get_part("rib_bracket")
    found = fit_views(part, replace(scan, points=deform(scan.points, Deformation(bend=1.0), part)), TOLERANCE, True)
    assert found is not None
    assert not found.disagree


def test_a_scan_without_views_is_not_compared() -> None:
    scan = make_scan(np.eye(4))
    assert fit_views(get_part("rib_bracket"), Scan(scan.points, noise=NOISE), TOLERANCE, True) is None


@pytest.mark.slow
def test_wear_that_one_view_alone_shows_is_not_fitted_away() -> None:
    """All of the top is worn, and only view 0 shows it: it lies with the others beside the top, and stays."""
    part = get_part("rib_bracket")
    points, normals = draw_skin("rib_bracket", 24_000)
    facing = normals @ SCANNERS.T > 0.1
    view = np.argmax(facing * np.random.default_rng(5).random(facing.shape), axis=1).astype(np.int32)
    top = normals[:, 2] > 0.9
    view[top] = 0
    worn = add_noise(points - 3 * TOLERANCE * top[:, None] * np.array([0.0, 0.0, 1.0]))
    for move in (np.eye(4), make_motion(0.4, 0.1)):
        moved = worn @ move[:3, :3].T + move[:3, 3]
        put = np.where((view == 1)[:, None], moved, worn)
        scan = Scan(put, noise=NOISE, spacing=0.8, viewpoints=SCANNERS, view=view)
        found = fit_views(part, scan, TOLERANCE, True)
        assert found is not None
        right = found.apply(scan).points
        assert np.linalg.norm(right[top] - worn[top], axis=1).max() < 0.3 * TOLERANCE
        if found.disagree:
            assert 0 not in [one.number for one in found.views if one.is_corrected]


@pytest.mark.slow
def test_files_without_scanner_positions_are_views_as_well() -> None:
    scan = make_scan(make_motion(0.8, 0.3))
    found = fit_views(
        get_part("rib_bracket"), Scan(scan.points, noise=NOISE, spacing=0.8, cloud=scan.view), TOLERANCE, True
    )
    assert found is not None
    assert [one.number for one in found.views if one.is_corrected] == [1]


def test_mixed_points_at_edges_are_no_misplaced_view() -> None:
    """A view that sees an edge has points beside skin that others show: they scatter, and are none of its skin."""
    part = PARTS["ribbed_plate"]()
    scan = Simulate(points=40_000, noise=0.04, scanners=6, mixed=0.03, outliers=0.02, seed=10).run(part.unit, part)
    noise, spacing = measure_noise_and_spacing(scan.points)
    found = fit_views(part, Scan(scan.points, noise=noise, spacing=spacing, cloud=scan.view), 0.25, True)
    assert found is not None
    assert not found.disagree


@pytest.mark.slow
def test_views_that_are_put_right_leave_no_doubt_that_the_scan_shows_this_part() -> None:
    """Only half of the scan lay on the part before."""
    part = PARTS["ribbed_plate"]()
    scanners = ((-150.0, -250.0, 300.0), (200.0, 150.0, 250.0), (0.0, 250.0, -300.0), (-200.0, -100.0, -250.0))
    simulate = Simulate(points=12_000, noise=0.04, seed=7, scanners=scanners, misplaced=0.6, pose="random")
    scan = simulate.run(part.unit, part)
    job = {"version": 1, "tolerance": 0.25, "report": "none"}
    result = damageest.run(job, part=part, scan=Scan(scan.points, viewpoints=scan.viewpoints, view=scan.view))
    assert result.fit is not None
    assert sum(view.is_corrected for view in result.fit.views) == 3
    assert not [doubt for doubt in result.pose.doubts if doubt.code == "another_part"]
    assert not [note for note in result.warnings if "another part" in note.text]
