"""Writes shapes as STEP AP242 with names and colours of solids and faces, alone or as an assembly.

Lengths are millimetres; the file is in the unit asked for. The same shapes give the same bytes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from damageest_cadquery.reading.read import explore
from damageest_cadquery.writing._canonical import canonicalise
from damageest_cadquery.writing._header import set_header
from damageest_cadquery.writing.step import UNITS

Colour = tuple[int, int, int]
SCHEMA = "AP242DIS"


@dataclass(frozen=True, eq=False)
class NamedShape:
    """``names`` and ``colours`` of the faces, in the order in which `explore` gives them; empty for none. A colour of
    None is that of the whole shape."""

    name: str
    shape: Any
    colour: Colour
    names: Sequence[str] = ()
    colours: Sequence[Colour | None] = ()

    def __post_init__(self) -> None:
        location = self.shape.Location()
        if not location.IsIdentity():  # OpenCASCADE would write an assembly of one
            from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
            from OCP.TopLoc import TopLoc_Location

            moved = BRepBuilderAPI_Transform(self.shape.Located(TopLoc_Location()), location.Transformation(), True)
            object.__setattr__(self, "shape", moved.Shape())


def write_assembly(path: Path, name: str, shapes: Sequence[NamedShape], unit: str, curves: bool = True) -> None:
    """Writes one product, or where there are several an assembly called ``name``.

    ``curves``: also write edges as curves in the parameters of the faces. Raises OSError.
    """
    from OCP.Message import Message
    from OCP.STEPCAFControl import STEPCAFControl_Controller, STEPCAFControl_Writer
    from OCP.STEPControl import STEPControl_AsIs
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    Message.DefaultMessenger_s().ChangePrinters().Clear()
    STEPCAFControl_Controller.Init_s()
    document = TDocStd_Document(TCollection_ExtendedString("damageest"))
    tool = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    colours = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    XCAFDoc_DocumentTool.SetLengthUnit_s(document, 0.001)
    labels = [_add(tool, colours, each) for each in shapes]
    if len(shapes) != 1:
        _join(tool, name, shapes, labels)
    with _set_options(unit, len(shapes) == 1, curves):
        writer = STEPCAFControl_Writer()
        writer.SetColorMode(True)
        writer.SetNameMode(True)
        writer.SetPropsMode(False)
        writer.SetLayerMode(False)
        if not writer.Transfer(document, STEPControl_AsIs):
            raise OSError(f"{path}: OpenCASCADE could not translate it")
        for each in shapes:
            _name_faces(writer, each)
        set_header(writer.ChangeWriter().Model())
        from OCP.IFSelect import IFSelect_RetDone

        if writer.Write(str(path)) != IFSelect_RetDone:
            raise OSError(f"{path}: OpenCASCADE could not write it")
    canonicalise(path)


def _add(tool: Any, colours: Any, each: NamedShape) -> Any:
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name
    from OCP.TopAbs import TopAbs_FACE
    from OCP.XCAFDoc import XCAFDoc_ColorGen, XCAFDoc_ColorSurf

    label = tool.AddShape(each.shape, False)
    TDataStd_Name.Set_s(label, TCollection_ExtendedString(each.name, True))
    colours.SetColor(label, _make_colour(each.colour), XCAFDoc_ColorGen)
    for number, face in enumerate(explore(each.shape, TopAbs_FACE)):
        colour = each.colours[number] if each.colours else None
        if colour is None:
            continue
        own = tool.AddSubShape(label, face)
        if own.IsNull():
            continue
        colours.SetColor(own, _make_colour(colour), XCAFDoc_ColorSurf)
    return label


def _name_faces(writer: Any, each: NamedShape) -> None:
    """Names the faces in the file. OpenCASCADE 7.9 does not write the names that sub-shapes have in its document.

    They are counted off in their shells: a face that its location moves is not found by itself.
    """
    from OCP.STEPConstruct import STEPConstruct
    from OCP.TCollection import TCollection_HAsciiString
    from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL
    from OCP.TopLoc import TopLoc_Location

    finder, names = writer.Writer().WS().TransferWriter().FinderProcess(), list(each.names)
    for shell in explore(each.shape, TopAbs_SHELL) if names else ():
        count = len(explore(shell, TopAbs_FACE))
        own, names = names[:count], names[count:]
        unmoved = shell.Located(TopLoc_Location())
        entity = STEPConstruct.FindEntity_s(finder, shell) or STEPConstruct.FindEntity_s(finder, unmoved)
        if entity is not None and entity.NbCfsFaces() == count:  # else one is missing, and the file is written again
            for number, name in enumerate(own, 1):
                entity.CfsFacesValue(number).SetName(TCollection_HAsciiString(name))


def _join(tool: Any, name: str, shapes: Sequence[NamedShape], labels: Sequence[Any]) -> None:
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name
    from OCP.TopLoc import TopLoc_Location

    whole = tool.NewShape()
    TDataStd_Name.Set_s(whole, TCollection_ExtendedString(name, True))
    for each, label in zip(shapes, labels, strict=True):
        placed = tool.AddComponent(whole, label, TopLoc_Location())
        TDataStd_Name.Set_s(placed, TCollection_ExtendedString(each.name, True))
    tool.UpdateAssemblies()


def _make_colour(colour: Colour) -> Any:
    from OCP.Quantity import Quantity_Color, Quantity_TOC_sRGB

    return Quantity_Color(*(value / 255 for value in colour), Quantity_TOC_sRGB)


class _set_options:  # noqa: N801
    """OpenCASCADE's settings for writing, which are global, set for a while."""

    def __init__(self, unit: str, alone: bool, curves: bool) -> None:
        self.wanted: dict[str, str | int] = {
            "write.step.unit": UNITS[unit],
            "write.step.schema": SCHEMA,
            "write.surfacecurve.mode": int(curves),
            "write.step.assembly": 0 if alone else 1,
        }
        self.before: dict[str, str | int] = {}

    def __enter__(self) -> None:
        from OCP.Interface import Interface_Static

        for key, value in self.wanted.items():
            if isinstance(value, str):
                self.before[key] = Interface_Static.CVal_s(key)
                Interface_Static.SetCVal_s(key, value)
            else:
                self.before[key] = Interface_Static.IVal_s(key)
                Interface_Static.SetIVal_s(key, value)

    def __exit__(self, *error: object) -> None:
        from OCP.Interface import Interface_Static

        for key, value in self.before.items():
            if isinstance(value, str):
                Interface_Static.SetCVal_s(key, value)
            else:
                Interface_Static.SetIVal_s(key, value)
