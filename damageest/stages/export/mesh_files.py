"""Solids and surfaces as STL and PLY, a file for each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from damageest.geometry.rounding import round_to_single
from damageest.io.meshes import write_ply, write_stl
from damageest.stages.export import Body, ExportedFiles


def write_stl_bodies(folder: Path, stem: str, bodies: Sequence[Body], unit: str) -> ExportedFiles:
    """Binary STL. Its coordinates are single precision: a solid that this would open is written as PLY too."""
    (body,) = bodies
    single = round_to_single(body.solid)
    write_stl(folder / f"{stem}.stl", single or body.solid)
    if single is not None:
        return ExportedFiles((f"{stem}.stl",))
    write_ply(folder / f"{stem}.ply", body.solid)
    note = f"{stem}.stl: single precision, which is all that STL has, opens this solid; {stem}.ply is whole"
    return ExportedFiles((f"{stem}.ply", f"{stem}.stl"), (note,))


def write_ply_bodies(folder: Path, stem: str, bodies: Sequence[Body], unit: str) -> ExportedFiles:
    """Binary PLY in double precision."""
    (body,) = bodies
    write_ply(folder / f"{stem}.ply", body.solid)
    return ExportedFiles((f"{stem}.ply",))
