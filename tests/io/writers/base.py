"""What a writer gives, and what several of them draw by chance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

Rng = np.random.Generator
SIZE = 60.0
"""The points lie in a cube of this edge."""


@dataclass(frozen=True)
class Written:
    """``files``: bytes by suffix or name, the first the one to read; ``points`` (N,3) that it has, in its order, or the
    set of them where ``ordered`` is False; ``refused``: what the reason has to say where it cannot be read. ``area``:
    of its faces, where it is a mesh, else 0. ``ways``: what was drawn."""

    files: dict[str, bytes]
    points: np.ndarray
    ways: dict[str, Any]
    error: float = 1e-4
    refused: str = ""
    ordered: bool = True
    normals: np.ndarray | None = None
    area: float = 0.0


class Draw:
    """Draws by chance, and notes what was drawn."""

    def __init__(self, rng: Rng) -> None:
        self.rng, self.ways = rng, dict[str, Any]()

    def one(self, name: str, *choices: Any) -> Any:
        self.ways[name] = choices[int(self.rng.integers(len(choices)))]
        return self.ways[name]

    def maybe(self, name: str, share: float = 0.5) -> bool:
        self.ways[name] = bool(self.rng.random() < share)
        return bool(self.ways[name])

    def points(self, count: int = 40) -> np.ndarray:
        """Points with a fraction of four digits that begins with 0 now and then."""
        self.one("shift", 0, 0, 250)
        return self.rng.uniform(-SIZE / 2, SIZE / 2, (count, 3)).round(4) + self.ways["shift"]

    def normals(self, count: int) -> np.ndarray:
        vectors = self.rng.normal(size=(count, 3))
        return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def box() -> tuple[np.ndarray, list[list[int]]]:
    """The corners (8,3) of a box of 3 x 4 x 5, area 94, and its six faces of four corners, outward."""
    corners = np.array([(x, y, z) for x in (0.0, 3.0) for y in (0.0, 4.0) for z in (0.0, 5.0)])
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return corners, faces


def split(face: list[int]) -> list[list[int]]:
    """A face of four corners as two triangles."""
    return [face[:3], [face[0], face[2], face[3]]]
