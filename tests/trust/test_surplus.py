"""What lies outside the skin: added metal, a displaced piece, or surroundings."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Scan
from damageest.findings import Surplus
from damageest.geometry.complement import complement_deviation, complement_part, complement_samples
from damageest.geometry.scan_field import ScanField
from damageest.stages.cluster.dbscan import Dbscan
from damageest.stages.sample.edge_aware import EdgeAware
from damageest.stages.segment.mesh_distance import MeshDistance
from damageest.trust.surplus import describe_surplus
from tests.surplus_scenes import NOISE, TOLERANCE, ball, block, part, scan, slab, table


def describe(points: Floats) -> tuple[Surplus, ...]:
    aligned = Scan(points, noise=NOISE, spacing=0.5)
    deviation = MeshDistance().run(aligned=aligned, part=part(), tolerance=TOLERANCE)
    losses = Dbscan().run(aligned=aligned, deviation=deviation, tolerance=TOLERANCE)
    turned = complement_deviation(deviation)
    clusters = Dbscan().run(aligned=aligned, deviation=turned, tolerance=TOLERANCE)
    return describe_surplus(clusters, losses, ScanField(part(), aligned, deviation, TOLERANCE))


def test_beads_are_surplus_with_height_and_area() -> None:
    low, high = sorted(describe(scan(block() + slab((6, 5, 2), 0, 0, 6) + ball(2, 12, 0, 4))), key=lambda s: s.height)
    assert {low.kind, high.kind} == {"surplus"}
    assert abs(low.height - 1) < 0.15
    assert abs(low.area - 30) < 15
    assert abs(high.height - 2) < 0.15
    assert not low.clusters


def test_a_table_is_a_plane_round_the_part() -> None:
    bead, plane = sorted(describe(np.concatenate([scan(block() + ball(2, 0, 0, 6)), table()])), key=lambda s: s.share)
    assert bead.kind == "surplus"
    assert plane.kind == "surroundings"
    assert "plane" in plane.notes[0]
    near = describe(np.concatenate([scan(block()), table(15.0, 4000)]))
    assert near[0].kind == "surroundings"  # cropped close to the part


def test_a_second_specimen_is_recognised_by_its_size() -> None:
    (second,) = describe(np.concatenate([scan(block()), scan(block(), seed=4) + np.array([30.0, 4, 0])]))
    assert second.kind == "surroundings"
    assert "second specimen" in second.notes[0]
    (clamp,) = describe(np.concatenate([scan(block()), scan(slab((8, 5, 40), 16.2, 0, 16), 5000)]))
    assert clamp.kind == "surroundings"
    assert "fixture" in clamp.notes[0]


def test_a_displaced_piece_has_a_loss_of_like_size_beside_it() -> None:
    corner = slab((8, 8, 20), 10, 7, 0)
    (piece,) = describe(scan((block() - corner) + (block() ^ corner).translate((0.4, 1.2, 0.8))))
    assert piece.kind == "displaced piece"
    assert piece.clusters == (1,)
    (bead,) = describe(scan(block() - ball(1, -3, 0, 6) + slab((8, 8, 3), 3, 0, 6)))
    assert (bead.kind, bead.clusters) == ("surplus", (1,))


def test_the_complement_of_a_part_is_the_space_round_it() -> None:
    whole = part()
    outside = complement_part(whole, np.array([[20.0, 0, 0]]), 2)
    assert np.isclose(outside.volume, (24 / 2 + 20 + 4) * (18 + 4) * (12 + 4) - whole.volume)
    samples = EdgeAware().run(part=whole, tolerance=1.0)
    assert (complement_samples(samples).normals == -samples.normals).all()
