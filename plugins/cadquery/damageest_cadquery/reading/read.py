"""Reading CAD files into OpenCASCADE solids, with their unit and the names of their faces."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from damageest.errors import InputError
from damageest.geometry.units import MILLIMETRES, canonical_unit
from damageest_cadquery._system import check


@dataclass(frozen=True)
class Model:
    """``solids``: OpenCASCADE shapes. ``unit``: the file's, None where it has none. ``length``: how many of
    OpenCASCADE's units of length are one of the file's. ``name_of`` gives a face's name in the file, or '';
    ``entity_of`` says which of the ADVANCED_FACE entities of a STEP file it is, from 0 in the file's order, or -1.
    ``closed``: the largest gap between surfaces that was closed, in OpenCASCADE's lengths; 0 where none was.
    """

    solids: list[Any]
    unit: str | None
    length: float
    name_of: Callable[[Any], str]
    notes: tuple[str, ...]
    solid_names: tuple[str, ...]
    entity_of: Callable[[Any], int]
    closed: float = 0.0


def read(path: Path, suffix: str, gap: float | None = None) -> Model:
    """The solids of a file. ``gap``: between surfaces that is closed at most, in OpenCASCADE's lengths, where the file
    holds no solid; None: a thousandth of the part.

    Raises InputError where it is unreadable or holds no solid, even sewn together, PluginError where a system library
    that OpenCASCADE loads is missing.
    """
    check()
    from OCP.Message import Message

    Message.DefaultMessenger_s().ChangePrinters().Clear()  # else OpenCASCADE writes into the program's own output
    reader = {".brep": _brep, ".iges": _iges, ".igs": _iges}.get(suffix, _step)
    shape, unit, name_of, entity_of = reader(path)
    if shape is None or shape.IsNull():
        raise InputError("holds no shape; export the part again as a solid")
    length = MILLIMETRES[unit] if unit else 1.0
    solids, closed = _solids(shape, gap)
    notes = () if closed is None else (_describe_closed(closed / length, unit or ""),)
    names = tuple(name_of(solid) for solid in solids)
    return Model(solids, unit, length, name_of, notes, names, entity_of, closed or 0.0)


def read_shape(path: Path) -> Any:
    """All that a STEP file holds as one shape, in millimetres. Raises InputError where it is unreadable or empty."""
    from OCP.Message import Message

    Message.DefaultMessenger_s().ChangePrinters().Clear()
    shape = _step(path)[0]
    if shape is None or shape.IsNull():
        raise InputError("holds no shape")
    return shape


_Content = tuple[Any, str | None, Callable[[Any], str], Callable[[Any], int]]
"""A shape, its unit, and what gives the name and the number of the entity of a face."""


def _no_name(face: Any) -> str:
    return ""


def _no_entity(face: Any) -> int:
    return -1


def _step(path: Path) -> _Content:
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TColStd import TColStd_SequenceOfAsciiString
    from OCP.TopLoc import TopLoc_Location

    reader = STEPControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_RetDone:
        raise InputError("not a readable STEP file; it may be cut short")
    lengths, angles, solid_angles = (TColStd_SequenceOfAsciiString() for _ in range(3))
    reader.FileUnits(lengths, angles, solid_angles)
    named = {lengths.Value(i + 1).ToCString() for i in range(lengths.Length())}
    units = {_unit(name) for name in named}
    if len(units) > 1 or None in units:
        units = {"mm"}  # OpenCASCADE converts each part of the file by its own unit, to millimetres
    reader.TransferRoots()

    def find_entity(face: Any) -> Any:
        transfer = reader.WS().TransferReader()  # asked anew: it forgets everything once its reader is gone
        unmoved = face.Located(TopLoc_Location())  # as it stands in the file, whatever the assembly does with it
        return transfer.EntityFromShapeResult(face, 1) or transfer.EntityFromShapeResult(unmoved, 1)

    face_entities: list[Any] = []
    place: dict[int, int] = {}

    def entity_of(face: Any) -> int:
        from OCP.StepShape import StepShape_AdvancedFace

        if not face_entities:
            model = reader.WS().Model()
            every = (model.Value(number + 1) for number in range(model.NbEntities()))
            face_entities.extend(one for one in every if isinstance(one, StepShape_AdvancedFace))
            # the model does not know an entity that came through Python; the same object is the same entity
            place.update({id(one): number for number, one in enumerate(face_entities)})
        return place.get(id(find_entity(face)), -1)

    def name_of(face: Any) -> str:
        entity = find_entity(face)
        name = entity.Name() if entity is not None and hasattr(entity, "Name") else None
        return name.ToCString() if name is not None else ""

    return reader.OneShape(), units.pop() if units else "mm", name_of, entity_of


def _iges(path: Path) -> _Content:
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.IGESControl import IGESControl_Reader

    reader = IGESControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_RetDone:
        raise InputError("not a readable IGES file; it may be cut short")
    name = reader.IGESModel().GlobalSection().UnitName()
    reader.TransferRoots()
    return reader.OneShape(), (_unit(name.ToCString()) if name is not None else None) or "mm", _no_name, _no_entity


def _brep(path: Path) -> _Content:
    from OCP.BRep import BRep_Builder
    from OCP.BRepTools import BRepTools
    from OCP.TopoDS import TopoDS_Shape

    with path.open("rb") as stream:
        if b"CASCADE Topology" not in stream.read(1000):  # OpenCASCADE would print its complaint
            raise InputError("not a BREP file: it does not name OpenCASCADE's topology")
    shape = TopoDS_Shape()
    if not BRepTools.Read_s(shape, str(path), BRep_Builder()):
        raise InputError("not a readable BREP file; it may be cut short")
    return shape, None, _no_name, _no_entity


def _unit(name: str) -> str | None:
    """A unit as STEP ('millimetre', 'INCH') or IGES ('MM', '2HIN') names it."""
    try:
        return canonical_unit(name.strip().lstrip("0123456789H").lower() if name[:1].isdigit() else name.strip())
    except InputError:
        return None


def _solids(shape: Any, gap: float | None) -> tuple[list[Any], float | None]:
    """The solids of a shape, and the largest gap between surfaces that was closed to make them; None where it has
    solids."""
    from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID

    solids = [solid for solid in explore(shape, TopAbs_SOLID) if explore(solid, TopAbs_FACE)]
    if solids:
        return solids, None
    if not explore(shape, TopAbs_FACE):
        raise InputError("holds neither solids nor faces, perhaps only points and curves; export the part as a solid")

    from damageest_cadquery.reading._sew import sew

    return sew(shape, gap)


def _describe_closed(gap: float, unit: str) -> str:
    """A note of what was sewn. ``gap``: the largest that was closed, in ``unit``."""
    sewn = "the file holds surfaces only: they were sewn together into a solid"
    return f"{sewn}, over gaps between them of up to {gap:.2g} {unit}".rstrip() if gap else sewn


def find_box(shapes: Iterable[Any]) -> Any:
    """OpenCASCADE's box round shapes; void where they have no faces."""
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    box = Bnd_Box()
    for shape in shapes:
        BRepBndLib.Add_s(shape, box, False)
    return box


def explore(shape: Any, kind: Any) -> list[Any]:
    """The sub-shapes of a kind, each as often as the shape uses it."""
    from OCP.TopExp import TopExp_Explorer

    found = []
    explorer = TopExp_Explorer(shape, kind)
    while explorer.More():
        found.append(explorer.Current())
        explorer.Next()
    return found
