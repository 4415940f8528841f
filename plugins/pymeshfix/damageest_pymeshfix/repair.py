"""Watertight meshes by MeshFix."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Mesh, Solid
from damageest.errors import StageError
from damageest.geometry.distance import distance_to_mesh
from damageest.stages.repair import Repair

MOST_LOST = 0.01
"""Share of a shell's area that its repair may remove."""


class PyMeshFix(Repair):
    """Repairs the enclosure by MeshFix (Attene 2010), shell by shell; a watertight one passes unchanged.

    Fills holes, turns flipped triangles, and separates pinched and intersecting triangles. Refused where the repaired
    mesh has another shape than the given one.
    """

    isolated: ClassVar[bool] = True
    renamed: ClassVar[Mapping[str, str]] = {"invented": "max_new_area"}
    use: Literal["pymeshfix"] = "pymeshfix"
    max_new_area: float = Field(
        0.03,
        ge=0,
        le=1,
        description="largest share of the repaired area that may be farther than the tolerance from the given mesh",
    )

    def run(self, enclosure: Mesh, tolerance: float) -> Solid:
        """Raises StageError where MeshFix closes nothing, or where the repaired mesh differs from the given one."""
        from damageest_pymeshfix._meshfix import close_shells, drop_unused_vertices, split_open_shells

        try:
            return Solid(enclosure.vertices, enclosure.faces)
        except ValueError as error:
            if not len(enclosure.faces):
                raise StageError(f"the enclosure cannot be repaired: {error}", method="implicit") from None
        mesh = drop_unused_vertices(enclosure.vertices, enclosure.faces)
        origin = mesh.bounds.mean(axis=0)
        mesh = Mesh(mesh.vertices - origin, mesh.faces)
        done: list[Solid] = []
        unclear: list[Mesh] = []
        for shell in split_open_shells(mesh):
            repaired = close_shells([shell])
            if (
                repaired
                and _measure_share_off(shell, repaired, tolerance) <= MOST_LOST
                and _measure_share_off(repaired, shell, tolerance) <= self.max_new_area
            ):
                done.append(repaired)
            else:  # much of it may be missing: another piece may belong to it
                unclear.append(shell)
        if unclear and (joined := close_shells(unclear)):
            done.append(joined)
        solid = _combine_shells(done, unclear)
        self._check_shape(solid, done, unclear, mesh, tolerance)
        return Solid(solid.vertices + origin, solid.faces)

    def _check_shape(self, solid: Solid, done: list[Solid], unclear: list[Mesh], given: Mesh, tolerance: float) -> None:
        """Raises StageError where the solid made of the repaired shells ``done`` differs from the ``given`` mesh."""
        added = _measure_share_off(solid, given, tolerance)
        if added > self.max_new_area:
            raise StageError(
                f"{added:.1%} of the repaired mesh's area is farther than the tolerance from the enclosure: a hole is "
                "too large to be filled",
                f"where the filled hole is right, repair.max_new_area: {1.1 * added:.2g}",
                method="implicit",
            )
        for piece in unclear:
            if (lost := min(_measure_share_off(piece, shell, tolerance) for shell in [*done, solid])) > MOST_LOST:
                raise StageError(
                    f"a piece of the enclosure, {len(piece.faces)} triangles, cannot be closed or joined to another: "
                    f"{lost:.0%} of it would be lost",
                    method="implicit",
                )
        over = float(np.abs(solid.bounds - given.bounds).max())
        if over > tolerance:
            raise StageError(
                f"the repaired mesh's bounds differ from the enclosure's by {over:.3g}, more than the tolerance",
                method="implicit",
            )


def _combine_shells(done: list[Solid], unclear: list[Mesh]) -> Solid:
    """All shells as one solid: overlapping ones united, cavities subtracted."""
    from damageest.geometry.solids import to_solid
    from damageest_pymeshfix._meshfix import combine_solids

    if not done:
        pieces = f", which is in {len(unclear)} pieces" if len(unclear) > 1 else ""
        raise StageError(f"MeshFix could not close the enclosure{pieces}", method="implicit")
    if len(done) == 1:
        return done[0]
    try:
        solid = to_solid(combine_solids(done))
    except ValueError as error:
        raise StageError(f"the repaired shells cannot be combined: {error}", method="implicit") from None
    if solid is None:
        raise StageError("the repaired shells together enclose no volume", method="implicit")
    return solid


def _measure_share_off(mesh: Mesh, other: Mesh, tolerance: float) -> float:
    """Share of the area of ``mesh`` farther than ``tolerance`` from ``other``."""
    area = 2 * mesh.face_areas
    distance = distance_to_mesh(mesh.triangles.mean(axis=1), other)
    return float(area[distance > tolerance].sum() / max(area.sum(), 1e-300))
