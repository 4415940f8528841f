"""Colours of the faces in a STEP file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from damageest_cadquery.reading.read import explore

Colour = tuple[int, int, int]


def read_colours(path: Path, count: int) -> list[Colour | None]:
    """The colour of each face, solid by solid, or of its solid; None where it has none.

    All None for a file of another format, and where the file has not ``count`` faces when read in this way.
    """
    nothing: list[Colour | None] = [None] * count
    if path.suffix.lower() not in (".step", ".stp"):
        return nothing
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.STEPCAFControl import STEPCAFControl_Reader
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDF import TDF_LabelSequence
    from OCP.TDocStd import TDocStd_Document
    from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    document = TDocStd_Document(TCollection_ExtendedString("damageest"))
    reader = STEPCAFControl_Reader()
    reader.SetColorMode(True)
    if reader.ReadFile(str(path)) != IFSelect_RetDone or not reader.Transfer(document):
        return nothing
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    colours = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    free = TDF_LabelSequence()
    shapes.GetFreeShapes(free)
    found: list[Colour | None] = []
    for number in range(1, free.Length() + 1):
        whole = shapes.GetShape_s(free.Value(number))
        for solid in explore(whole, TopAbs_SOLID):
            own = _find(colours, solid) or _find(colours, whole)
            found += [_find(colours, face) or own for face in explore(solid, TopAbs_FACE)]
    return found if len(found) == count else nothing


def _find(colours: Any, shape: Any) -> Colour | None:
    from OCP.Quantity import Quantity_Color, Quantity_TOC_sRGB
    from OCP.TopLoc import TopLoc_Location
    from OCP.XCAFDoc import XCAFDoc_ColorGen, XCAFDoc_ColorSurf

    colour = Quantity_Color()
    for each in (shape, shape.Located(TopLoc_Location())):  # as it stands in the file, wherever an assembly puts it
        for kind in (XCAFDoc_ColorSurf, XCAFDoc_ColorGen):
            if colours.GetColor(each, kind, colour):
                red, green, blue = (round(255 * value) for value in colour.Values(Quantity_TOC_sRGB))
                return red, green, blue
    return None
