"""Stock of given height on given skin, for programs that compare theirs with the stage's."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh
from damageest.stages.allowance._skin import SkinFaces
from damageest.stages.allowance._stock import build_stock


def build_plain_stock(skin: Mesh, height: Floats, origin: Floats, tolerance: float) -> Any:
    """Stock as `allowance: milling` builds it, without targets, regions to keep free or overlap: a Manifold about
    ``origin`` (3,) with stock of ``height`` (F,) on each triangle of ``skin``, whose neighbours share vertices.

    As with that stage, it is on curved skin up to a quarter of ``tolerance`` higher, reaches a little below the skin,
    and may lie in metal that stands over the skin.
    """
    count = len(skin.faces)
    own = SkinFaces(
        skin.vertices - origin, skin.faces, np.zeros(count, np.int64), skin.face_normals, np.asarray(height),
        np.zeros(count, bool),
    )  # fmt: skip
    return build_stock(own, tolerance / 2)
