"""Watertight meshes pass, others are refused."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Mesh
from damageest.errors import StageError
from damageest.stages.repair.none import NoRepair

BOX = trimesh.creation.box((3, 2, 1))


def test_watertight_passes_unchanged() -> None:
    solid = NoRepair().run(Mesh(BOX.vertices, BOX.faces))
    assert solid.volume == pytest.approx(6)
    assert np.array_equal(solid.faces, BOX.faces)


@pytest.mark.parametrize(
    ("faces", "why"),
    [
        (BOX.faces[1:], "watertight"),
        (BOX.faces[:, ::-1], "inside out"),
        (np.vstack([BOX.faces, BOX.faces[:1]]), "watertight"),
    ],
)
def test_anything_else_is_refused_with_a_remedy(faces: np.ndarray, why: str) -> None:
    with pytest.raises(StageError, match=why) as caught:
        NoRepair().run(Mesh(BOX.vertices, faces))
    assert "implicit" in caught.value.remedy
