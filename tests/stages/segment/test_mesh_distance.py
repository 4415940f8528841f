"""Labels of scan points by their signed distance to the part."""

from __future__ import annotations

import numpy as np
import trimesh

from damageest.artefacts import ADDED, DAMAGE, INTACT, Part, Scan
from damageest.stages.segment.mesh_distance import MeshDistance


def test_labels() -> None:
    mesh = trimesh.creation.box((10, 10, 10))
    points = np.array([[0, 0, 5.0], [0, 0, 4.85], [0, 0, 4.5], [0, 0, 5.15], [0, 0, 6.0]])
    part = Part(mesh.vertices, mesh.faces)
    deviation = MeshDistance().run(Scan(points), part, 0.2)
    assert deviation.label.tolist() == [INTACT, INTACT, DAMAGE, INTACT, ADDED]
    deviation = MeshDistance(threshold=0.5).run(Scan(points), part, 0.2)
    assert deviation.label.tolist() == [INTACT, DAMAGE, DAMAGE, ADDED, ADDED]
    assert np.allclose(deviation.distance, [0, -0.15, -0.5, 0.15, 1.0])


def test_empty_scan() -> None:
    mesh = trimesh.creation.box((10, 10, 10))
    assert len(MeshDistance().run(Scan(np.empty((0, 3))), Part(mesh.vertices, mesh.faces), 0.2).label) == 0
