"""Writes what the scan shows of the skin."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Mesh
from damageest.findings import Coverage
from damageest.geometry.transforms import move_mesh
from damageest.io.meshes import write_ply
from damageest.stages.export import ExportedFiles


def write_coverage(coverage: Coverage, T: Floats | None, folder: Path, place: str) -> ExportedFiles:
    """Writes ``skin.ply``, the skin in cells, and ``unseen.ply``, the cells of the unseen regions, below ``place``.

    ``T`` (4,4) takes a point from the part's frame to that of the files. Properties of a face of skin.ply: ``seen`` (0
    or 1), ``distance`` (mean signed distance of the scan to it, NaN where no point is near), ``lost`` (1: rays of the
    scanner passed through it), ``region`` (the number of its unseen region, from 1; 0: none). A face of unseen.ply has
    the number of its region.
    """
    skin = move_mesh(coverage.skin, T)
    region = (coverage.region + 1).astype(np.int32)
    path = folder / f"{place}skin.ply"
    path.parent.mkdir(parents=True, exist_ok=True)
    columns: dict[str, NDArray[Any]] = {
        "seen": coverage.is_seen.astype(np.uint8),
        "distance": coverage.distance.astype(np.float32),
        "lost": coverage.is_lost.astype(np.uint8),
        "region": region,
    }
    write_ply(path, skin, columns)
    names = [f"{place}skin.ply"]
    chosen = coverage.region >= 0
    if chosen.any():
        used, renumbered = np.unique(skin.faces[chosen], return_inverse=True)
        unseen = Mesh(skin.vertices[used], renumbered.reshape(-1, 3))
        write_ply(folder / f"{place}unseen.ply", unseen, {"region": region[chosen]})
        names.append(f"{place}unseen.ply")
    return ExportedFiles(tuple(names))
