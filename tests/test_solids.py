from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Mesh
from damageest.solids import to_arrays, to_manifold


def test_there_and_back_far_from_the_origin_in_float64() -> None:
    box = trimesh.creation.box((1, 2, 3))
    origin = np.array([1e7, -1e7, 5.0])
    body = to_manifold(Mesh(box.vertices + origin, box.faces), origin)
    assert body.volume() == pytest.approx(6, rel=1e-8)
    vertices, faces = to_arrays(body, origin)
    assert faces.dtype == np.int64
    assert np.allclose(np.unique(vertices, axis=0), np.unique(box.vertices + origin, axis=0), atol=1e-8, rtol=0)


def test_an_open_mesh_is_refused() -> None:
    box = trimesh.creation.box((1, 2, 3))
    with pytest.raises(ValueError, match="refuses"):
        to_manifold(Mesh(box.vertices, box.faces[:-1]))
