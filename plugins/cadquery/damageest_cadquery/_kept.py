"""Keeps what the process for exact solids has found, so that the next one goes on after it."""

from __future__ import annotations

import os
import pickle
from pathlib import Path
from typing import Any

from damageest_cadquery._request import Made
from damageest_cadquery._sites import Solved

MADE = "made.pickle"


class _Pickler(pickle.Pickler):
    """Shapes go into one compound, so that those that share faces still do."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.shapes: list[Any] = []

    def persistent_id(self, value: Any) -> int | None:
        from OCP.TopoDS import TopoDS_Shape

        if not isinstance(value, TopoDS_Shape):
            return None
        self.shapes.append(value)
        return len(self.shapes) - 1


class _Unpickler(pickle.Unpickler):
    shapes: list[Any]

    def persistent_load(self, number: Any) -> Any:
        return self.shapes[number]


def keep_solved(folder: str, number: int, solved: Solved) -> None:
    """Keeps what was found for a site; a file that a crash leaves half written has another name."""
    from OCP.BinTools import BinTools
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Compound

    stem = Path(folder) / f"site-{number}"
    with stem.with_suffix(".pickle").open("wb") as file:
        pickler = _Pickler(file)
        pickler.dump(solved)
    builder, whole = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(whole)
    for shape in pickler.shapes:
        builder.Add(whole, shape)
    half = stem.with_suffix(".half")
    BinTools.Write_s(whole, str(half))
    os.replace(half, stem.with_suffix(".shapes"))


def find_solved(folder: str, number: int) -> Solved | None:
    """What an earlier process has found for a site; None where it has not come to its end."""
    from OCP.BinTools import BinTools
    from OCP.TopoDS import TopoDS_Iterator, TopoDS_Shape

    stem = Path(folder) / f"site-{number}"
    if not folder or not stem.with_suffix(".shapes").exists():
        return None
    whole, shapes = TopoDS_Shape(), []
    BinTools.Read_s(whole, str(stem.with_suffix(".shapes")))
    walk = TopoDS_Iterator(whole)
    while walk.More():
        shapes.append(_cast(walk.Value()))
        walk.Next()
    with stem.with_suffix(".pickle").open("rb") as file:
        unpickler = _Unpickler(file)
        unpickler.shapes = shapes
        solved: Solved = unpickler.load()
    return solved


def _cast(shape: Any) -> Any:
    from OCP.TopAbs import TopAbs_COMPOUND, TopAbs_SOLID
    from OCP.TopoDS import TopoDS

    kinds = {TopAbs_SOLID: TopoDS.Solid_s, TopAbs_COMPOUND: TopoDS.Compound_s}
    return kinds.get(shape.ShapeType(), lambda same: same)(shape)


def keep_made(folder: str, made: Made) -> None:
    """Keeps which files were written, and what is to be said of all sites."""
    half = Path(folder) / "made.half"
    half.write_bytes(pickle.dumps(made))
    os.replace(half, half.with_name(MADE))


def find_made(folder: str) -> Made:
    """What the last process wrote; nothing where it wrote no file."""
    file = Path(folder) / MADE
    if not file.exists():
        return Made((), (), {})
    made: Made = pickle.loads(file.read_bytes())
    return made
