"""VTK files, read by pyvista: legacy .vtk, and .vtp and .vtu in XML; points or meshes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Bytes
from damageest.errors import InputError
from damageest.geometry.units import canonical_unit
from damageest.io.points import FormatError, PointFile
from damageest.io.points.attributes import find_confidence, find_unit
from damageest.io.points.mesh import NOTE
from damageest.isolation import ProcessError, call_isolated

UNIT_NAMES = ("unit", "units", "lengthunit", "lengthunits")
"""Names of field data with the unit of lengths, without '_' and spaces, in small letters."""
MOST_PACKED = 1100
"""Largest ratio of unpacked data to a file in XML, whose compression reaches 1030."""
_LINE = re.compile(rb"^[A-Za-z_][!-~]{0,99}(?: +[!-~]{1,40}){1,4}[ \r]*$", re.MULTILINE)


def read(path: Path, columns: str | None = None) -> PointFile:
    """The points, those on the outside alone of a mesh of solid cells, with normals, colours and confidence.

    VTK reads in a process of its own, since damaged files crash it.
    """
    _check_numbers(path)
    try:
        return call_isolated(_read, {"path": path}, worker="vtk", show=False)
    except ProcessError as error:
        raise FormatError(f"the file is damaged, or too large: VTK, which reads it, {error.message}") from None


def _read(path: Path) -> PointFile:
    import pyvista

    with pyvista.VtkErrorCatcher(raise_errors=False, send_to_logging=False) as caught:
        data: Any = pyvista.get_reader(str(path)).read()
    if events := getattr(caught, "error_events", None) or caught.events:
        told = " ".join(str(getattr(events[0], "alert", events[0])).split())
        raise FormatError(f"the VTK file is truncated or not valid ({told[:120]})")
    if not isinstance(data, (pyvista.PolyData, pyvista.UnstructuredGrid, pyvista.StructuredGrid)):
        raise FormatError(f"holds a {type(data).__name__}, not points or a mesh")
    notes = (NOTE,) if _find_dimension(data) > 0 else ()
    if _find_dimension(data) > 2:
        data = _find_outside(data)
        notes = ("the file is a mesh of solid cells; the vertices on its outside are used as the scan's points",)
    points = np.array(data.points, np.float64).reshape(-1, 3)
    arrays = {name: np.array(data.point_data[name]) for name in data.point_data.keys()}  # noqa: SIM118
    confidence = find_confidence(name for name, values in arrays.items() if values.ndim == 1)
    normals = next((v for n, v in arrays.items() if n.lower() == "normals" and v.shape == points.shape), None)
    unit, said = _find_unit(path, data)
    return PointFile(
        points,
        None if normals is None else normals.astype(np.float64),
        unit=unit,
        unit_said=said,
        notes=notes,
        colours=_find_colours(arrays),
        confidence=None if confidence is None else arrays[confidence].astype(np.float32),
    )


def _check_numbers(path: Path) -> None:
    """Raises FormatError for numbers of points or cells that the file is too small for: they are allocated."""
    data = path.read_bytes()
    if path.suffix.lower() != ".vtk":
        if b"<!DOCTYPE" in data[:65536] or b"<!ENTITY" in data[:65536]:
            raise FormatError("the XML of the VTK file declares entities, which no VTK file needs")
        if b"<VTKFile" not in data[:65536]:
            raise FormatError("not a VTK file: it has no element VTKFile")
        numbers = [int(n) for n in re.findall(rb'\bNumberOf\w+\s*=\s*"\s*(\d{1,30})', data)]
        if any(number > MOST_PACKED * len(data) for number in numbers):
            raise FormatError("the VTK file is truncated: it is too small for the numbers in its header")
        return
    if not data.startswith(b"# vtk DataFile"):
        raise FormatError("not a VTK file: it does not start with '# vtk DataFile'")
    for line in _LINE.findall(data):
        words = line.split()[1:]
        numbers = [int(word) for word in words if word.isdigit()]
        if any(number > len(data) for number in numbers):
            raise FormatError(_describe(line))
        is_array = len(words) == 3 and words[0].isdigit() and words[1].isdigit() and not words[2].isdigit()
        if is_array and numbers[0] * numbers[1] > len(data):  # a field array: components, tuples, type
            raise FormatError(_describe(line))


def _describe(line: bytes) -> str:
    return f"the VTK file is truncated: it is too small for '{line.decode('latin-1').strip()[:60]}'"


def _find_dimension(data: Any) -> int:
    """The largest dimension of a cell: 0 for points, 2 for triangles, 3 for tetrahedra; 0 without cells."""
    if not data.n_cells:
        return 0
    if not hasattr(data, "celltypes"):
        return 2 if data.n_cells > getattr(data, "n_verts", 0) else 0
    first = np.unique(np.asarray(data.celltypes), return_index=True)[1]
    return max((data.GetCell(int(index)).GetCellDimension() for index in first), default=0)


def _find_outside(data: Any) -> Any:
    """The surface of a mesh of solid cells."""
    import pyvista
    from vtkmodules.vtkFiltersGeometry import vtkGeometryFilter

    outside = vtkGeometryFilter()
    outside.SetInputData(data)
    outside.Update()
    return pyvista.wrap(outside.GetOutput())


def _find_colours(arrays: dict[str, Any]) -> Bytes | None:
    """The first point array of three or four bytes."""
    found = (v for v in arrays.values() if v.dtype == np.uint8 and v.ndim == 2 and v.shape[1] in (3, 4))
    values = next(found, None)
    return None if values is None else np.ascontiguousarray(values[:, :3])


def _find_unit(path: Path, data: Any) -> tuple[str | None, str]:
    """The unit that field data name, else that the title of a legacy file does, and where it stands."""
    for name in data.field_data.keys():  # noqa: SIM118
        if name.lower().replace("_", "").replace(" ", "") not in UNIT_NAMES:
            continue
        text = str(next(iter(np.ravel(np.asarray(data.field_data[name]))), ""))
        try:
            return canonical_unit(text), f"{name}: {text}"
        except InputError:
            continue
    if path.suffix.lower() != ".vtk":
        return None, ""
    with path.open("rb") as stream:
        return find_unit([line.decode("latin-1") for line in stream.read(1024).split(b"\n")[1:2]])
