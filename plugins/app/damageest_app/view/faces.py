"""Faces of the part that a person clicks: CAD faces, or smooth patches of a mesh, and how a job names them."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Ints, Part
from damageest.geometry.smooth_faces import label_smooth_faces

SMOOTH = 12.0
"""Degrees between neighbouring triangles up to which they are one face."""
FLAT = 3.0
"""Degrees of its normals up to which a face is named by its direction too."""


class Faces:
    """``labels`` (F,): the number of the face that each triangle of the part belongs to."""

    def __init__(self, part: Part) -> None:
        self.part = part
        self.labels: Ints = part.faces_brep if part.faces_brep is not None else _find_smooth(part)

    def select(self, triangle: int) -> int | dict[str, Any]:
        """How a job names the face of a triangle: the number of the CAD face, else a selector of skin."""
        number = int(self.labels[triangle])
        if self.part.faces_brep is not None:
            return number
        own = self.labels == number
        corners = self.part.triangles[own].reshape(-1, 3)
        pad = 1e-3 * self.part.diagonal
        selector: dict[str, Any] = {"box": [corners.min(axis=0) - pad, corners.max(axis=0) + pad]}
        normals = self.part.face_normals[own]
        mean = self.part.cross[own].sum(axis=0)
        length = np.linalg.norm(mean)
        if length > 0:
            angle = float(np.degrees(np.arccos(np.clip((normals @ (mean / length)).min(), -1, 1))))
            if angle < 80:
                direction = np.round(mean / length, 6)
                selector["facing"] = {"direction": direction, "angle": FLAT if angle < FLAT else round(angle + 2, 1)}
        return selector

    def describe(self, named: Any) -> str:
        """A face of a job in words."""
        if isinstance(named, (int, str)):
            return f"CAD face {named}"
        if not isinstance(named, dict):
            return str(named)
        if named.get("faces"):
            return "CAD face " + ", ".join(map(str, named["faces"]))
        words = []
        if named.get("facing"):
            words.append("facing (" + ", ".join(f"{x:.3g}" for x in named["facing"]["direction"]) + ")")
        if named.get("box"):
            middle = np.mean(np.array(named["box"], float), axis=0)
            words.append("near (" + ", ".join(f"{x:.4g}" for x in middle) + ")")
        return "skin " + " ".join(words) if words else ", ".join(f"{key}: {value}" for key, value in named.items())

    def match(self, named: Any) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """(F,) the triangles that a face of a job selects, by the core's own selectors."""
        from damageest.geometry.selectors import Selector

        if isinstance(named, (int, str)):
            named = {"faces": [named]}
        keys = {key: value for key, value in named.items() if key in Selector.model_fields}
        if not keys:
            return np.zeros(len(self.part.faces), bool)
        selector = Selector.model_validate(keys)
        rows = np.arange(len(self.part.faces))
        return selector.matches(self.part.triangles.mean(axis=1), self.part.face_normals, rows, self.part)


def _find_smooth(part: Part) -> Ints:
    """Patches of triangles that meet at less than `SMOOTH`."""
    return label_smooth_faces(part.faces, part.face_normals, float(np.cos(np.radians(SMOOTH))))
