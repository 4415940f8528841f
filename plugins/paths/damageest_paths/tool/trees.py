"""Meshes as the FCL library has them."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Mesh


def make_tree(mesh: Mesh) -> Any:
    """FCL's tree of boxes over the triangles of a mesh."""
    import fcl

    tree = fcl.BVHModel()
    tree.beginModel(len(mesh.vertices), len(mesh.faces))
    tree.addSubModel(np.ascontiguousarray(mesh.vertices), np.ascontiguousarray(mesh.faces))
    tree.endModel()
    return tree
