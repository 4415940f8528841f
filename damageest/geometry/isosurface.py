"""The positive side of a field on a grid, as a solid."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Solid
from damageest.geometry.poisson import Grid, GridValues


def extract_region(grid: Grid, field: GridValues) -> Solid | None:
    """Where the field is positive, closed by the walls of the grid; None where it is so nowhere."""
    from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D

    scale = float(np.abs(field).max())
    if not scale > 0:
        return None
    # A level that passes exactly through a node would make triangles of no area, so zeros are pushed to one side.
    values = np.where(np.abs(field) < 1e-5 * scale, 1e-5 * scale, field)
    values = np.pad(values, 1, constant_values=-scale).astype(np.float32)
    image = vtkImageData()
    image.SetDimensions(*values.shape)
    image.SetOrigin(-1.0, -1.0, -1.0)
    image.GetPointData().SetScalars(numpy_to_vtk(values.ravel(order="F"), deep=True))
    edges = vtkFlyingEdges3D()
    edges.SetInputData(image)
    edges.SetValue(0, 0.0)
    edges.ComputeNormalsOff()
    edges.ComputeGradientsOff()
    edges.ComputeScalarsOff()
    edges.Update()
    mesh = edges.GetOutput()
    if not mesh.GetNumberOfPolys():
        return None
    vertices = vtk_to_numpy(mesh.GetPoints().GetData()).astype(np.float64) * grid.cell + grid.origin
    faces = vtk_to_numpy(mesh.GetPolys().GetConnectivityArray()).reshape(-1, 3).astype(np.int64)
    corners = vertices[faces] - grid.origin
    if np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) < 0:
        faces = faces[:, ::-1]
    return Solid(vertices, faces)
