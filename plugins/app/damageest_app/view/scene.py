"""What the 3D view shows: layers by name, each an actor of VTK. The browser draws them with vtk.js; meshes and points
are thinned out for it, and full data stay here."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkPolyDataNormals, vtkQuadricDecimation
from vtkmodules.vtkRenderingCore import vtkActor, vtkLight, vtkPolyDataMapper, vtkRenderer, vtkRenderWindow

from damageest.artefacts import Floats, Mesh

MOST_TRIANGLES = 150_000
"""Triangles of a layer that the browser draws."""
MOST_POINTS = 120_000
"""Points of a layer that the browser draws."""
GROUNDS = {False: (0.957, 0.965, 0.973), True: (0.075, 0.09, 0.11)}
"""Background by whether the page is dark."""
Colours = NDArray[np.uint8]


class Scene:
    """A render window with one actor for each layer."""

    def __init__(self) -> None:
        self.renderer = vtkRenderer()
        self.window = vtkRenderWindow()
        self.window.SetOffScreenRendering(1)
        self.window.AddRenderer(self.renderer)
        light = vtkLight()  # a view without layers and lights is not sent, and the browser would keep the last one
        light.SetLightTypeToHeadlight()
        self.renderer.AddLight(light)
        self.layers: dict[str, Any] = {}
        self.bounds: dict[str, Floats] = {}
        self._retired: list[Any] = []
        self.set_dark(False)

    def set_dark(self, dark: bool) -> None:
        self.renderer.SetBackground(*GROUNDS[dark])

    def put(self, name: str, data: Any, *, colour: str = "#9aa5ad", opacity: float = 1.0, size: float = 2.0) -> None:
        """Shows a layer; one of the same name is replaced."""
        self.remove(name)
        if data is None or not data.GetNumberOfPoints():
            return
        mapper, actor = vtkPolyDataMapper(), vtkActor()
        mapper.SetInputData(data)
        mapper.SetScalarVisibility(data.GetPointData().GetScalars() is not None)
        actor.SetMapper(mapper)
        look = actor.GetProperty()
        look.SetColor(*to_rgb(colour))
        look.SetOpacity(opacity)
        look.SetPointSize(size)
        look.SetLineWidth(size)
        look.SetLighting(data.GetNumberOfPolys() > 0)
        look.SetAmbient(0.2)
        look.SetDiffuse(0.8)
        look.SetSpecular(0.1)
        self.renderer.AddActor(actor)
        self.layers[name] = actor
        self.bounds[name] = np.array(data.GetBounds()).reshape(3, 2).T

    def remove(self, *names: str) -> None:
        """Hides layers. Their actors stay, without data: the browser knows objects by their addresses, and would draw
        a mixture where another one is made at the address of one that was freed."""
        for name in names:
            if actor := self.layers.pop(name, None):
                self.renderer.RemoveActor(actor)
                actor.GetMapper().SetInputData(vtkPolyData())
                self._retired.append(actor)
                self.bounds.pop(name)

    def clear(self) -> None:
        self.remove(*self.layers)

    def frame(self, names: tuple[str, ...] = (), direction: Floats | None = None, near: float = 1.12) -> dict[str, Any]:
        """Puts the camera where it sees these layers, by default all; gives it as vtk.js takes it."""
        chosen = [self.bounds[name] for name in names if name in self.bounds] or list(self.bounds.values())
        if not chosen:
            return self.camera()
        low = np.min([one[0] for one in chosen], axis=0)
        high = np.max([one[1] for one in chosen], axis=0)
        return self.look_at((low + high) / 2, near * float(np.linalg.norm(high - low)), direction)

    def look_at(self, centre: Floats, width: float, direction: Floats | None = None) -> dict[str, Any]:
        """Puts the camera before ``centre`` so that ``width`` fills the view; ``direction`` (3,) from there to it."""
        out = np.array([0.55, -0.95, 0.6]) if direction is None else np.array(direction, float)
        out /= np.linalg.norm(out)
        up = np.array([0.0, 0.0, 1.0]) if abs(out[2]) < 0.95 else np.array([0.0, 1.0, 0.0])
        camera = self.renderer.GetActiveCamera()
        distance = width / 2 / np.sin(np.radians(camera.GetViewAngle() / 2))
        camera.SetFocalPoint(*centre)
        camera.SetPosition(*(np.asarray(centre) + distance * out))
        camera.SetViewUp(*up)
        self.renderer.ResetCameraClippingRange()
        return self.camera()

    def camera(self) -> dict[str, Any]:
        camera = self.renderer.GetActiveCamera()
        focal = list(camera.GetFocalPoint())
        return {
            "focalPoint": focal,
            "position": list(camera.GetPosition()),
            "viewUp": list(camera.GetViewUp()),
            "viewAngle": camera.GetViewAngle(),
            "centerOfRotation": focal,
        }


def to_rgb(colour: str) -> tuple[float, float, float]:
    """#rrggbb as shares."""
    red, green, blue = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return red, green, blue


def make_mesh(mesh: Mesh | None, colours: Colours | None = None) -> Any:
    """A mesh for the view, with normals that keep edges sharp. ``colours`` (F,3): of each triangle."""
    if mesh is None or not len(mesh.faces):
        return None
    vertices, faces = mesh.vertices, mesh.faces
    if colours is not None:  # colours belong to corners, so that all layers have one kind
        vertices, faces = mesh.triangles.reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3)
    data = _make_data(vertices)
    cells = np.column_stack([np.full(len(faces), 3), faces]).astype(np.int64).ravel()
    polys = vtkCellArray()
    polys.SetCells(len(faces), numpy_to_vtkIdTypeArray(cells, deep=True))
    data.SetPolys(polys)
    if colours is not None:
        _set_colours(data, np.repeat(colours, 3, axis=0))
    elif len(faces) > MOST_TRIANGLES:
        fewer = vtkQuadricDecimation()
        fewer.SetInputData(data)
        fewer.SetTargetReduction(1 - MOST_TRIANGLES / len(faces))
        fewer.Update()
        data = fewer.GetOutput()
    normals = vtkPolyDataNormals()
    normals.SetInputData(data)
    normals.SetFeatureAngle(30.0)
    normals.SetSplitting(colours is None)
    normals.ConsistencyOff()
    normals.Update()
    return normals.GetOutput()


def lift(mesh: Mesh | None, amount: float) -> Mesh | None:
    """The mesh a little larger, so that it is drawn over a surface that it shares with another one."""
    if mesh is None or not len(mesh.faces):
        return None
    return Mesh(mesh.vertices + amount * mesh.vertex_normals, mesh.faces)


def thin(count: int, most: int = MOST_POINTS) -> NDArray[np.int64]:
    """The numbers of about ``most`` of ``count`` points, spread evenly over their order."""
    if count <= most:
        return np.arange(count)
    return np.sort(np.random.default_rng(0).choice(count, most, replace=False))


def make_points(points: Floats, colours: Colours | None = None, most: int = MOST_POINTS) -> Any:
    """Points for the view; ``colours`` (N,3)."""
    chosen = thin(len(points), most)
    data = _make_data(points[chosen])
    count = len(chosen)
    cells = np.column_stack([np.ones(count), np.arange(count)]).astype(np.int64).ravel()
    verts = vtkCellArray()
    verts.SetCells(count, numpy_to_vtkIdTypeArray(cells, deep=True))
    data.SetVerts(verts)
    if colours is not None:
        _set_colours(data, colours[chosen])
    return data


def make_lines(pieces: list[Floats], colours: list[Colours] | None = None) -> Any:
    """Polylines (K,3) for the view, each with a colour for each of its points."""
    pieces = [piece for piece in pieces if len(piece) > 1]
    if not pieces:
        return None
    data = _make_data(np.concatenate(pieces))
    cells, start = [], 0
    for piece in pieces:
        cells.append(np.concatenate([[len(piece)], np.arange(start, start + len(piece))]))
        start += len(piece)
    lines = vtkCellArray()
    lines.SetCells(len(pieces), numpy_to_vtkIdTypeArray(np.concatenate(cells).astype(np.int64), deep=True))
    data.SetLines(lines)
    if colours is not None:
        _set_colours(data, np.concatenate(colours))
    return data


def _make_data(points: Floats) -> Any:
    holder = vtkPoints()
    holder.SetData(numpy_to_vtk(np.ascontiguousarray(points, np.float32), deep=True))
    data = vtkPolyData()
    data.SetPoints(holder)
    return data


def _set_colours(data: Any, colours: Colours) -> None:
    array = numpy_to_vtk(np.ascontiguousarray(colours, np.uint8), deep=True)
    array.SetName("colours")
    data.GetPointData().SetScalars(array)
