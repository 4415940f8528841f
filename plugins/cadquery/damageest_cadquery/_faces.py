"""What the faces of a CAD model are: kind, area, centre, and the direction and size that a job may name them by."""

from __future__ import annotations

from typing import Any

from damageest.stages.part import CadFace, Vector
from damageest_cadquery._read import Model, explore
from damageest_cadquery._tessellate import kind_of


def faces(model: Model, scale: float) -> tuple[CadFace, ...]:
    """All faces, solid by solid; ``scale`` is what OpenCASCADE's lengths are multiplied by."""
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopoDS import TopoDS

    found = [TopoDS.Face_s(face) for solid in model.solids for face in explore(solid, TopAbs_FACE)]
    return tuple(_face(number, face, model.name_of(face), scale) for number, face in enumerate(found))


def _face(number: int, face: Any, name: str, scale: float) -> CadFace:
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps
    from OCP.TopAbs import TopAbs_REVERSED

    sizes = GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, sizes)
    adaptor = BRepAdaptor_Surface(face)
    kind = kind_of(adaptor)
    shown: dict[str, Any] = {}
    if kind in ("plane", "cylinder", "cone", "sphere", "torus"):
        surface = getattr(adaptor, kind.capitalize())()
        place = surface.Position()
        # a surface's own normal points away from its axis, or along it, where its frame is right-handed
        outward = place.Direct() != (face.Orientation() == TopAbs_REVERSED)
        if kind == "plane":
            shown["normal"] = _vector(place.Direction(), 1.0 if outward else -1.0)
        else:
            shown["point"] = _vector(place.Location(), scale)
        if kind in ("cylinder", "cone", "torus"):
            shown["axis"] = _vector(place.Direction(), 1.0)
        if kind in ("cylinder", "sphere"):
            shown |= {"radius": surface.Radius() * scale, "hollow": not outward}
        if kind == "torus":
            shown["radius"] = surface.MajorRadius() * scale
    elif kind == "surface_of_revolution":
        axis = adaptor.AxeOfRevolution()
        shown = {"axis": _vector(axis.Direction(), 1.0), "point": _vector(axis.Location(), scale)}
    return CadFace(number, name, kind, sizes.Mass() * scale**2, _vector(sizes.CentreOfMass(), scale), **shown)


def _vector(of: Any, scale: float) -> Vector:
    x, y, z = of.Coord()
    return x * scale + 0.0, y * scale + 0.0, z * scale + 0.0  # + 0.0 turns -0 into 0
