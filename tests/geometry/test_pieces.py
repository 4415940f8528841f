"""Pieces of a damage volume and the sites they form, on bodies whose pieces and clusters are known."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import Manifold

from damageest.artefacts import Solid, open_edges
from damageest.geometry.pieces import FEWEST_POINTS, find_pieces, join_pieces
from damageest.geometry.solids import to_arrays
from tests.geometry.shapes import FAR
from tests.scenes import spread

ONE = Manifold.cube((4, 4, 4))
OTHER = Manifold.cube((4, 4, 4)).translate((10, 0, 0))
SPLINTER = Manifold.cube((0.2, 0.2, 0.2)).translate((20, 0, 0))


def solid(body: Manifold) -> Solid:
    return Solid(*to_arrays(body))


def on(body: Manifold, count: int = 60, seed: int = 0) -> np.ndarray:
    return spread(solid(body), count, np.random.default_rng(seed))[0]


def test_a_piece_without_points_on_it_is_dropped() -> None:
    points = on(ONE)
    pieces, dropped = find_pieces(solid(ONE + SPLINTER), points, np.ones(60, int), 0.1)
    assert [piece.clusters for piece in pieces] == [(1,)]
    assert pieces[0].solid.volume == pytest.approx(64)
    assert dropped == pytest.approx(0.008)


def test_two_pieces_with_clusters_of_their_own_are_two_sites() -> None:
    points, label = np.concatenate([on(ONE), on(OTHER)]), np.repeat([1, 2], 60)
    pieces, _ = find_pieces(solid(ONE + OTHER), points, label, 0.1)
    assert sorted(site.clusters for site in join_pieces(pieces)) == [(1,), (2,)]


def test_one_cluster_over_two_pieces_is_one_site() -> None:
    points = np.concatenate([on(ONE), on(OTHER)])
    (site,) = join_pieces(find_pieces(solid(ONE + OTHER), points, np.ones(120, int), 0.1)[0])
    assert site.damage.volume == pytest.approx(128)
    assert open_edges(site.damage.faces) == 0


def test_two_clusters_that_bound_one_piece_are_one_site() -> None:
    points = on(ONE, 200)
    label = np.where(points[:, 0] < 2, 1, 2)
    (site,) = join_pieces(find_pieces(solid(ONE), points, label, 0.1)[0])
    assert site.clusters == (1, 2)


def test_pieces_that_overlap_are_united() -> None:
    shifted = ONE.translate((2, 0, 0))
    pieces = [*find_pieces(solid(ONE), on(ONE), np.ones(60, int), 0.1)[0]]
    pieces += find_pieces(solid(shifted), on(shifted), np.ones(60, int), 0.1)[0]
    (site,) = join_pieces(pieces)
    assert site.damage.volume == pytest.approx(96)


def test_without_pieces_there_is_no_site() -> None:
    assert join_pieces([]) == []


def test_a_few_points_of_another_cluster_do_not_bound_a_piece() -> None:
    few = FEWEST_POINTS - 1
    points, label = np.concatenate([on(ONE), on(ONE, few, 1), on(ONE, 60, 2)]), np.repeat([1, 2, 3], [60, few, 60])
    pieces, _ = find_pieces(solid(ONE), points, label, 0.1)
    assert [piece.clusters for piece in pieces] == [(1, 3)]
    none, dropped = find_pieces(solid(ONE), points[60:64], label[60:64], 0.1)
    assert none == []
    assert dropped == pytest.approx(64)


def test_pieces_are_found_far_from_the_origin() -> None:
    far = Solid(solid(ONE + OTHER).vertices + FAR, solid(ONE + OTHER).faces)
    points, label = np.concatenate([on(ONE), on(OTHER)]) + FAR, np.repeat([1, 2], 60)
    pieces, dropped = find_pieces(far, points, label, 0.1)
    assert sorted(piece.clusters for piece in pieces) == [(1,), (2,)]
    assert dropped == 0
