"""Sites on a plate with pits of known place; nothing on a plate without."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.artefacts import DAMAGE, INTACT, Deviation, Scan
from damageest.stages.cluster import _density
from damageest.stages.cluster._density import run_dbscan
from damageest.stages.cluster.dbscan import Dbscan, find_sharpest_bend
from tests.needs import import_or_skip

SIZE = 60.0
SIGMA = 0.04
TOLERANCE = 4 * SIGMA


def plate(
    n: int, pits: list[tuple[float, float, float]] = (), shift: float = 0.0, outliers: float = 0.0, uneven: float = 1.0
) -> tuple[Scan, Deviation, np.ndarray]:
    """A noisy scan of a plate's top at z=0, its signed distances, and the pit (0: none) that each point is really in.

    ``pits``: x, y, radius of flat-bottomed pits 1 mm deep; ``uneven``: density at one side over that at the other.
    """
    rng = np.random.default_rng(7)
    xy = rng.uniform(0, SIZE, (n, 2))
    if uneven > 1:
        xy = xy[rng.uniform(0, uneven, n) < 1 + (uneven - 1) * xy[:, 0] / SIZE]
    n = len(xy)
    z = rng.normal(0, SIGMA, n) - shift
    pit = np.zeros(n, int)
    for i, (x, y, radius) in enumerate(pits, 1):
        pit[np.hypot(xy[:, 0] - x, xy[:, 1] - y) < radius] = i
    z -= pit > 0
    stray = rng.random(n) < outliers
    xy[stray] = rng.uniform(0, SIZE, (int(stray.sum()), 2))
    z[stray] = rng.uniform(-10, 10, int(stray.sum()))
    pit[stray] = 0
    label = np.where(z < -TOLERANCE, DAMAGE, INTACT)
    points = np.column_stack([xy, z])
    return Scan(points), Deviation(z, np.zeros(n, int), label), pit


@pytest.mark.variants(3)
@pytest.mark.parametrize("n", [150_000, 1_000_000])
@pytest.mark.parametrize("shift", [0.0, SIGMA])
@pytest.mark.parametrize("outliers", [0.0, 0.01])
def test_no_damage_no_site(n: int, shift: float, outliers: float) -> None:
    scan, deviation, _ = plate(n, shift=shift, outliers=outliers)
    assert (deviation.label == DAMAGE).any()
    for eps in (None, "auto"):
        assert Dbscan(eps=eps).run(scan, deviation, TOLERANCE).count == 0


@pytest.mark.parametrize("n", [150_000, 1_000_000])
@pytest.mark.parametrize("outliers", [0.0, 0.01])
def test_small_pit_is_kept(n: int, outliers: float) -> None:
    scan, deviation, pit = plate(n, [(20, 20, 2 * TOLERANCE)], shift=SIGMA, outliers=outliers)
    sites = Dbscan().run(scan, deviation, TOLERANCE)
    assert sites.count == 1
    assert (sites.label[pit == 1] == 1).mean() > 0.95
    assert (pit[sites.members(1)] == 1).mean() > 0.9


def test_sites_are_numbered_by_size_and_repeat() -> None:
    scan, deviation, pit = plate(150_000, [(10, 10, 2), (40, 40, 6), (15, 45, 4)], outliers=0.01)
    sites = Dbscan().run(scan, deviation, TOLERANCE)
    assert sites.count == 3
    for site, true in ((1, 2), (2, 3), (3, 1)):
        assert np.bincount(pit[sites.members(site)], minlength=4).argmax() == true
    assert np.array_equal(Dbscan().run(scan, deviation, TOLERANCE).label, sites.label)
    assert "are in no site" in sites.notes[0]


def test_uneven_density_leaves_one_damage_whole() -> None:
    scan, deviation, pit = plate(150_000, [(30, 30, 25)], uneven=5.0)
    sites = Dbscan().run(scan, deviation, TOLERANCE)
    assert sites.count == 1
    assert (sites.label[pit == 1] == 1).mean() > 0.99


def test_auto_finds_both_damages_among_outliers() -> None:
    scan, deviation, pit = plate(150_000, [(15, 15, 5), (45, 45, 5)], outliers=0.01)
    sites = Dbscan(eps="auto").run(scan, deviation, TOLERANCE)
    assert sites.count == 2
    assert (sites.label[pit > 0] > 0).mean() > 0.99


def test_sharpest_bend() -> None:
    flat, steep = np.linspace(1, 2, 900), np.linspace(2, 30, 101)[1:]
    assert find_sharpest_bend(np.random.default_rng(0).permutation(np.concatenate([flat, steep]))) == pytest.approx(
        2, abs=0.2
    )
    assert find_sharpest_bend(np.array([1.0])) == np.inf


@pytest.mark.slow
def test_same_clusters_as_scikit_learn() -> None:
    rng = np.random.default_rng(0)
    points = np.concatenate([rng.normal(c, 0.5, (300, 3)) for c in (0, 4, 8)] + [rng.uniform(-5, 12, (200, 3))])
    reference = import_or_skip("sklearn.cluster").DBSCAN(eps=0.5, min_samples=8, algorithm="kd_tree")
    ours, theirs = run_dbscan(points, 0.5, 8), reference.fit(points)
    assert np.array_equal(ours < 0, theirs.labels_ < 0)
    core = theirs.core_sample_indices_
    assert len(np.unique(np.stack([ours[core], theirs.labels_[core]]), axis=1).T) == len(
        np.unique(theirs.labels_[core])
    )


@pytest.mark.slow
def test_gathering_dense_points_keeps_the_clusters(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    points = np.concatenate([rng.normal(c, 0.5, (3000, 3)) for c in (0, 9)])
    whole = run_dbscan(points, 0.8, 10)
    monkeypatch.setattr(_density, "MAX_PAIRS", 1000)
    gathered = run_dbscan(points, 0.8, 10)
    same = (whole >= 0) & (gathered >= 0)
    assert same.mean() > 0.99
    assert len(np.unique(np.stack([whole[same], gathered[same]]), axis=1).T) == 2


def test_eps_below_the_spacing_is_noted() -> None:
    scan, deviation, _ = plate(20_000, [(30, 30, 10)])
    sites = Dbscan(eps="tolerance").run(scan, deviation, TOLERANCE)
    assert any("below the gaps" in note for note in sites.notes)


@pytest.mark.parametrize(
    ("share", "uneven"), [(0.003, 1), (0.003, 4), (0.02, 1), (0.02, 4), (0.1, 1), (0.1, 4), (0.3, 1)]
)
def test_the_bend_separates_clusters_from_noise(share: float, uneven: int) -> None:
    """Two squares, the second with its points ``uneven`` times farther apart, with noise around them."""
    rng = np.random.default_rng(0)
    squares = [rng.uniform(0, 10, (5000, 2)), rng.uniform(0, 10, (5000 // uneven**2, 2)) + np.array([25, 0])]
    flat = np.concatenate(squares)
    points = np.column_stack([flat, np.zeros(len(flat))])
    noise = rng.uniform([-10, -10, -15], [45, 20, 15], (int(share * len(points)), 3))
    average = _density.measure_neighbour_distances(np.concatenate([points, noise]), 10)
    eps = find_sharpest_bend(average)
    assert (average[: len(points)] <= eps).mean() > 0.95
    assert (average[len(points) :] <= eps).mean() < 0.1


def notch(stray: int) -> tuple[Scan, Deviation]:
    """The sparse scan of a plate 5 thick with a notch 50 x 40 through it, whose walls show a few points each, and
    ``stray`` points inside the plate, anywhere."""
    rng = np.random.default_rng(2)
    size = np.array([400.0, 400.0])
    top = np.column_stack([rng.uniform(0, size, (9000, 2)), np.zeros(9000)])
    top = top[~((top[:, 0] < 40) & (np.abs(top[:, 1] - 200) < 25))]
    back = np.column_stack([np.full(14, 40.0), np.linspace(176, 224, 14), rng.uniform(-4, -1, 14)])
    side = np.column_stack([np.linspace(3, 33, 5), np.zeros(5), rng.uniform(-4, -1, 5)])
    walls = np.concatenate([back, side + np.array([0, 175, 0]), side + np.array([0, 225, 0])])
    lost = np.column_stack([rng.uniform(0, size, (stray, 2)), rng.uniform(-4, -1, stray)])
    points = np.concatenate([top, walls, lost])
    label = np.where(points[:, 2] < 0, DAMAGE, INTACT).astype(np.uint8)
    return Scan(points, noise=0.05, spacing=4.2), Deviation(points[:, 2], np.zeros(len(points), np.int32), label)


def test_walls_with_few_points_belong_to_the_notch_that_they_bound() -> None:
    scan, deviation = notch(stray=0)
    assert np.bincount(Dbscan().run(scan, deviation, 0.25).label[deviation.label == DAMAGE])[1:].tolist() == [24]


def test_stray_points_near_a_notch_belong_to_no_site() -> None:
    scan, deviation = notch(stray=40)
    sites = Dbscan().run(scan, deviation, 0.25)
    assert (sites.label[-40:] == 0).mean() > 0.8
