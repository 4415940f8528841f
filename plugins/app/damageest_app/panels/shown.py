"""What several steps show: the scan, and the part with faces in colours."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Flags, Floats
from damageest_app.inputs import Inputs
from damageest_app.view.faces import Faces
from damageest_app.view.scene import Scene, make_mesh, make_points, to_rgb
from damageest_app.view.shade import tint

SCAN = "#d97a34"
REMOVED = "#e0218a"
SKIN = "#9aa5ad"


def put_scan(scene: Scene, inputs: Inputs, offset: Floats, removed: Flags | None = None) -> None:
    """Shows the scan of a job, moved by ``offset`` (3,); those of the shown points that are ``removed`` (M,) in
    another colour."""
    colours = tint(inputs.shade, SCAN)
    if removed is not None:
        colours[removed] = tint(inputs.shade[removed], REMOVED)
    scene.put("scan", make_points(inputs.scan.points[inputs.shown] + offset, colours), size=2.5)


def place_beside(bounds: Floats, points: Floats) -> Floats:
    """By how much (3,) the scan is moved, so that it is seen beside the part."""
    if not len(points):
        return np.zeros(3)
    low, high = points.min(axis=0), points.max(axis=0)
    gap = 0.15 * float(np.linalg.norm(bounds[1] - bounds[0]))
    middle = bounds.mean(axis=0) - (low + high) / 2
    return np.array([bounds[1][0] + gap - low[0], middle[1], middle[2]])


def put_faces(scene: Scene, faces: Faces, named: list[tuple[Any, str]]) -> None:
    """Shows the part with some of its faces in colours; the last colour of a face holds."""
    colours = np.empty((len(faces.part.faces), 3), np.uint8)
    colours[:] = np.round(255 * np.array(to_rgb(SKIN)))
    for face, colour in named:
        colours[faces.match(face)] = np.round(255 * np.array(to_rgb(colour)))
    scene.put("part", make_mesh(faces.part, colours))
