"""Solids as STL and PLY, one file for each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from damageest.geometry.rounding import round_to_single
from damageest.io.meshes import write_ply, write_stl
from damageest.stages.export import Body, ExportedFiles


def write_stl_bodies(folder: Path, stem: str, bodies: Sequence[Body], unit: str) -> ExportedFiles:
    """Writes binary STL. Where rounding to single precision opens the solid, PLY is written too."""
    (body,) = bodies
    single = round_to_single(body.solid)
    write_stl(folder / f"{stem}.stl", single or body.solid)
    if single is not None:
        return ExportedFiles((f"{stem}.stl",))
    write_ply(folder / f"{stem}.ply", body.solid)
    note = f"{stem}.stl: not watertight, because STL has only single precision; {stem}.ply is watertight"
    return ExportedFiles((f"{stem}.ply", f"{stem}.stl"), (note,))


def write_ply_bodies(folder: Path, stem: str, bodies: Sequence[Body], unit: str) -> ExportedFiles:
    """Writes binary PLY in double precision."""
    (body,) = bodies
    write_ply(folder / f"{stem}.ply", body.solid)
    return ExportedFiles((f"{stem}.ply",))
