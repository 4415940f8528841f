"""Ways in which a whole part differs from its CAD: fields of displacement of low order, after a rigid motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from damageest.artefacts import Floats, Mesh

Kind = Literal["scale", "stretch", "shear", "bend", "lean", "twist"]

COMPACT = 0.8
"""Share of the box along the axes of the part's frame that a box along the principal axes has to be smaller than, for
the fields to follow the principal axes."""


@dataclass(frozen=True)
class Field:
    """One field: its ``kind``, the number of the axis ``along`` which it changes, and the axis ``across`` it."""

    kind: Kind
    along: int = 0
    across: int = 0

    def evaluate(self, q: Floats) -> Floats:
        """The displacement (N,3) at places ``q`` (N,3), along the frame's axes and in half-diagonals of the part."""
        out = np.zeros_like(q)
        a, b = self.along, self.across
        if self.kind == "scale":
            out[:] = q
        elif self.kind == "stretch":
            out[:, a] = q[:, a]
        elif self.kind == "shear":
            out[:, a], out[:, b] = q[:, b], q[:, a]
        elif self.kind == "bend":  # cross-sections turn with the axis
            out[:, b] = q[:, a] ** 2
            out[:, a] = -2 * q[:, a] * q[:, b]
        elif self.kind == "lean":  # how cross-sections turn otherwise than those of a thin bent rod
            out[:, a] = q[:, a] * q[:, b]
        else:
            u, v = (a + 1) % 3, (a + 2) % 3
            out[:, u], out[:, v] = -q[:, a] * q[:, v], q[:, a] * q[:, u]
        return out


SCALE = (Field("scale"),)
STRETCHES = tuple(Field("stretch", axis) for axis in range(3))
SHEARS = tuple(Field("shear", *pair) for pair in ((0, 1), (1, 2), (2, 0)))
TWISTS = tuple(Field("twist", axis) for axis in range(3))
BENDS = tuple(Field("bend", a, b) for a in range(3) for b in range(3) if a != b)
LEANS = tuple(Field("lean", one.along, one.across) for one in BENDS)
EVERY = (*STRETCHES, *SHEARS, *TWISTS, *BENDS, *LEANS)


@dataclass(frozen=True, eq=False)
class FieldFrame:
    """Where fields are evaluated: ``centre`` (3,) of the part, ``axes`` (3,3) as rows, ``half``: half its diagonal."""

    centre: Floats
    axes: Floats
    half: float

    def list_motions(self, points: Floats, normals: Floats) -> Floats:
        """How far each of six rigid motions moves points (N,3) along normals (N,3), as (N,6): rotations about the
        centre, as displacement at ``half``, and shifts."""
        return np.concatenate([np.cross((points - self.centre) / self.half, normals), normals], axis=1)

    def evaluate(self, fields: tuple[Field, ...], points: Floats) -> Floats:
        """The displacement (K,N,3) of points (N,3) by each of K fields with coefficient 1, in the part's frame."""
        q = (points - self.centre) @ self.axes.T / self.half
        return np.array([field.evaluate(q) @ self.axes for field in fields]).reshape(len(fields), len(points), 3)

    def sum_up(self, fields: tuple[Field, ...], coefficients: Floats, points: Floats) -> Floats:
        """The displacement (N,3) of points (N,3) by the fields with their coefficients (K,)."""
        return np.asarray(np.einsum("k,knj->nj", coefficients, self.evaluate(fields, points)))


def choose_frame(part: Mesh, corners: Floats) -> FieldFrame:
    """The frame of a part: along the axes of its CAD, or along its principal axes where the part is much more compact
    along these. ``corners`` (N,3): points spread over its skin."""
    centre = part.bounds.mean(axis=0)
    principal = np.linalg.eigh(np.cov((corners - centre).T))[1].T
    principal[2] = np.cross(principal[0], principal[1])
    size = [float(np.prod(np.ptp((corners - centre) @ axes.T, axis=0))) for axes in (np.eye(3), principal)]
    axes = principal if size[1] < COMPACT * size[0] else np.eye(3)
    return FieldFrame(centre, np.asarray(axes), part.diagonal / 2)
