"""The positive side of a field on a voxel grid, as a solid."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Solid
from damageest.geometry.poisson import Grid, GridValues


def extract_region(grid: Grid, field: GridValues) -> Solid | None:
    """The solid where a field is positive, closed by the walls of the grid; None where the field is nowhere positive.

    Args:
        grid: the places of the field's nodes; the solid is in its unit and frame.
        field: (shape of the grid) values of any unit at the nodes.

    By vtk's flying edges, a form of marching cubes (Schroeder et al. 2015). Values below 1e-5 of the largest count as
    positive. Raises ArtefactError where rounding leaves a mesh that is not watertight.
    """
    from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D

    scale = float(np.abs(field).max())
    if not scale > 0:
        return None
    # A zero level exactly at a node would give triangles without area, so values near zero are moved to one side.
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
