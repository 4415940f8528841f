"""Watertight meshes by MeshFix."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Mesh, Solid
from damageest.errors import StageError
from damageest.geometry.distance import distance_to_mesh
from damageest.stages.repair import Repair

LOST = 0.01
"""Share of a shell's area that its repair may take away."""
REMEDY = "method: implicit, which closes by construction"


class PyMeshFix(Repair):
    """MeshFix (Attene 2010), shell by shell: fills holes, turns flipped triangles, takes pinches and intersections
    apart. Passes a watertight mesh on as it is, and refuses where the repaired one is another shape than the given."""

    use: Literal["pymeshfix"] = "pymeshfix"
    invented: float = Field(
        0.03, ge=0, le=1, description="largest share of the repaired area farther than the tolerance from the given one"
    )

    def run(self, enclosure: Mesh, tolerance: float) -> Solid:
        """Raises StageError where nothing closed comes about, or the repaired mesh strays from the given one."""
        from damageest_pymeshfix._meshfix import closed, shells, trimmed

        try:
            return Solid(enclosure.vertices, enclosure.faces)
        except ValueError as error:
            if not len(enclosure.faces):
                raise StageError(f"the enclosure is not to be repaired: {error}", REMEDY) from None
        mesh = trimmed(enclosure.vertices, enclosure.faces)
        origin = mesh.bounds.mean(axis=0)
        mesh = Mesh(mesh.vertices - origin, mesh.faces)
        sound: list[Solid] = []
        doubtful: list[Mesh] = []
        for shell in shells(mesh):
            repaired = closed([shell])
            if (
                repaired
                and _share_off(shell, repaired, tolerance) <= LOST
                and _share_off(repaired, shell, tolerance) <= self.invented
            ):
                sound.append(repaired)
            else:  # where much is missing, another piece may belong to it
                doubtful.append(shell)
        if doubtful and (joined := closed(doubtful)):
            sound.append(joined)
        solid = _one(sound, doubtful)
        self._check(solid, sound, doubtful, mesh, tolerance)
        return Solid(solid.vertices + origin, solid.faces)

    def _check(self, solid: Solid, sound: list[Solid], doubtful: list[Mesh], given: Mesh, tolerance: float) -> None:
        """Raises StageError where the solid made of ``sound`` shells strays from the ``given`` mesh."""
        added = _share_off(solid, given, tolerance)
        if added > self.invented:
            raise StageError(
                f"{added:.1%} of the repaired mesh's area is farther than the tolerance from the enclosure: a hole is "
                "too large to be filled by guess",
                f"{REMEDY}, or, where the patch is right, invented: {1.1 * added:.2g}",
            )
        for piece in doubtful:
            if (lost := min(_share_off(piece, shell, tolerance) for shell in [*sound, solid])) > LOST:
                raise StageError(
                    f"a piece of the enclosure of {len(piece.faces)} triangles does not close and belongs to no other; "
                    f"{lost:.0%} of it would be lost",
                    REMEDY,
                )
        over = float(np.abs(solid.bounds - given.bounds).max())
        if over > tolerance:
            raise StageError(
                f"the repaired mesh's bounds differ from the enclosure's by {over:.3g}, more than the tolerance", REMEDY
            )


def _one(sound: list[Solid], doubtful: list[Mesh]) -> Solid:
    """All shells as one solid: united where they overlap, those that bound a cavity taken out."""
    from damageest.geometry.solids import to_solid
    from damageest_pymeshfix._meshfix import assembled

    if not sound:
        pieces = f"; it is in {len(doubtful)} pieces" if len(doubtful) > 1 else ""
        raise StageError(f"MeshFix finds nothing in the enclosure that closes{pieces}", REMEDY)
    if len(sound) == 1:
        return sound[0]
    try:
        solid = to_solid(assembled(sound))
    except ValueError as error:
        raise StageError(f"the repaired shells do not go together: {error}", REMEDY) from None
    if solid is None:
        raise StageError("the repaired shells enclose nothing together", REMEDY)
    return solid


def _share_off(mesh: Mesh, other: Mesh, tolerance: float) -> float:
    """Share of the area of ``mesh`` farther than ``tolerance`` from ``other``."""
    area = np.linalg.norm(mesh.cross, axis=1)
    distance = distance_to_mesh(mesh.triangles.mean(axis=1), other)
    return float(area[distance > tolerance].sum() / max(area.sum(), 1e-300))
