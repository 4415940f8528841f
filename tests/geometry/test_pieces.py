"""From pieces of lost material to sites, on bodies whose pieces and clusters are known."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import Manifold

from damageest.artefacts import Solid, open_edges
from damageest.geometry.pieces import find_pieces, join_pieces
from damageest.geometry.solids import to_arrays
from tests.scenes import spread

ONE = Manifold.cube((4, 4, 4))
OTHER = Manifold.cube((4, 4, 4)).translate((10, 0, 0))
SCRAP = Manifold.cube((0.2, 0.2, 0.2)).translate((20, 0, 0))


def solid(body: Manifold) -> Solid:
    return Solid(*to_arrays(body))


def on(body: Manifold, count: int = 60, seed: int = 0) -> np.ndarray:
    return spread(solid(body), count, np.random.default_rng(seed))[0]


def test_a_piece_that_no_damaged_point_touches_is_a_scrap() -> None:
    points = on(ONE)
    pieces, dropped = find_pieces(solid(ONE + SCRAP), points, np.ones(60, int), 0.1)
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


def test_no_piece_no_site() -> None:
    assert join_pieces([]) == []
