"""Lists the faces of a CAD model: kind, area, centre, direction and size."""

from __future__ import annotations

from typing import Any

from damageest.artefacts import Vector
from damageest.stages.part import CadFace
from damageest_cadquery.reading.read import Model, explore
from damageest_cadquery.reading.tessellate import name_kind


def list_faces(model: Model, scale: float) -> tuple[CadFace, ...]:
    """All faces, solid by solid; lengths are OpenCASCADE's times ``scale``."""
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopoDS import TopoDS

    found = [TopoDS.Face_s(face) for solid in model.solids for face in explore(solid, TopAbs_FACE)]
    return tuple(_describe_face(number, face, model.name_of(face), scale) for number, face in enumerate(found))


def number_entities(model: Model) -> dict[int, int]:
    """The number of the CAD face of each ADVANCED_FACE entity of a STEP file, by the entity's place among them."""
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopoDS import TopoDS

    found = [TopoDS.Face_s(face) for solid in model.solids for face in explore(solid, TopAbs_FACE)]
    entities = [model.entity_of(face) for face in found]
    return {entity: number for number, entity in enumerate(entities) if entity >= 0}


def _describe_face(number: int, face: Any, name: str, scale: float) -> CadFace:
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps
    from OCP.TopAbs import TopAbs_REVERSED

    sizes = GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, sizes)
    adaptor = BRepAdaptor_Surface(face)
    kind = name_kind(adaptor)
    shown: dict[str, Any] = {}
    if kind in ("plane", "cylinder", "cone", "sphere", "torus"):
        surface = getattr(adaptor, kind.capitalize())()
        place = surface.Position()
        # where the surface's frame is right-handed, its normal points away from its axis, or along the axis of a plane
        outward = place.Direct() != (face.Orientation() == TopAbs_REVERSED)
        if kind == "plane":
            shown["normal"] = _to_vector(place.Direction(), 1.0 if outward else -1.0)
        else:
            shown["point"] = _to_vector(place.Location(), scale)
        if kind in ("cylinder", "cone", "torus"):
            shown["axis"] = _to_vector(place.Direction(), 1.0)
        if kind in ("cylinder", "sphere"):
            shown |= {"radius": surface.Radius() * scale, "hollow": not outward}
        if kind == "torus":
            shown["radius"] = surface.MajorRadius() * scale
    elif kind == "surface_of_revolution":
        axis = adaptor.AxeOfRevolution()
        shown = {"axis": _to_vector(axis.Direction(), 1.0), "point": _to_vector(axis.Location(), scale)}
    return CadFace(number, name, kind, sizes.Mass() * scale**2, _to_vector(sizes.CentreOfMass(), scale), **shown)


def _to_vector(of: Any, scale: float) -> Vector:
    x, y, z = of.Coord()
    return x * scale + 0.0, y * scale + 0.0, z * scale + 0.0  # + 0.0 turns -0 into 0
