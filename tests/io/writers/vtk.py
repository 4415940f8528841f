"""VTK files, from the description of the formats, and E57 files, by pye57's own writer."""

from __future__ import annotations

import base64
import struct
import tempfile
from pathlib import Path

import numpy as np

from tests.io.writers.base import Draw, Rng, Written


def write_vtk(rng: Rng) -> Written:
    """The legacy format, points as POLYDATA or UNSTRUCTURED_GRID."""
    draw = Draw(rng)
    points = draw.points()
    form, kind = draw.one("form", "ASCII", "BINARY"), draw.one("kind", "float", "double")
    version, title = draw.one("version", "2.0", "3.0", "4.2"), draw.one("title", "scan", "a title, of words")
    data = f"# vtk DataFile Version {version}\n{title}\n".encode()
    grid = draw.one("grid", "POLYDATA", "UNSTRUCTURED_GRID")
    data += f"{form}\nDATASET {grid}\nPOINTS 40 {kind}\n".encode()

    def add(values: np.ndarray, code: str) -> bytes:
        if form == "BINARY":
            return values.astype(">" + code).tobytes() + b"\n"
        words = [f"{v:.9g}" if code[0] == "f" else str(int(v)) for v in values.ravel()]
        wide = draw.one("numbers of a line", 3, 9, 1)
        return ("\n".join(" ".join(words[k : k + wide]) for k in range(0, len(words), wide)) + "\n").encode()

    data += add(points, "f4" if kind == "float" else "f8")
    cells = np.column_stack([np.ones(40), np.arange(40)])
    if grid == "UNSTRUCTURED_GRID":
        data += b"CELLS 40 80\n" + add(cells, "i4") + b"CELL_TYPES 40\n" + add(np.ones(40), "i4")
    elif draw.maybe("vertices"):
        data += b"VERTICES 40 80\n" + add(cells, "i4")
    normals = draw.normals(40) if draw.maybe("normals") else None
    if normals is not None:
        data += b"POINT_DATA 40\nNORMALS Normals float\n" + add(normals, "f4")
    return Written({".vtk": data}, points, draw.ways, normals=normals)


def write_vtp(rng: Rng) -> Written:
    """PolyData in XML."""
    draw = Draw(rng)
    points = draw.points()
    form = draw.one("form", "ascii", "binary", "appended raw", "appended base64")
    kind, code = draw.one("kind", ("Float32", "<f4"), ("Float64", "<f8"))
    head, mark = draw.one("count", ("UInt32", "<I"), ("UInt64", "<Q"))
    normals = draw.normals(40) if draw.maybe("normals") else None
    blocks: list[bytes] = []

    def add(name: str, values: np.ndarray) -> str:
        said = f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="3"'
        body = values.astype(code).tobytes()
        block = struct.pack(mark, len(body)) + body
        if form == "ascii":
            return f'{said} format="ascii">{" ".join(f"{v:.9g}" for v in values.ravel())}</DataArray>'
        if form == "binary":
            return f'{said} format="binary">\n{base64.b64encode(block).decode()}\n</DataArray>'
        place = sum(map(len, blocks))
        blocks.append(base64.b64encode(block) if "base64" in form else block)
        return f'{said} format="appended" offset="{place}"/>'

    point_data = f'<PointData Normals="Normals">{add("Normals", normals)}</PointData>' if normals is not None else ""
    body = f"{point_data}<Points>{add('Points', points)}</Points>"
    text = (
        '<?xml version="1.0"?>\n<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian"'
        f' header_type="{head}"><PolyData><Piece NumberOfPoints="40" NumberOfVerts="0" NumberOfLines="0"'
        f' NumberOfStrips="0" NumberOfPolys="0">{body}</Piece></PolyData>'
    ).encode()
    if blocks:
        text += f'<AppendedData encoding="{form.split()[1]}">_'.encode() + b"".join(blocks) + b"</AppendedData>"
    return Written({".vtp": text + b"</VTKFile>"}, points, draw.ways, normals=normals)


def write_e57(rng: Rng) -> Written:
    """One scan or several, each with its pose, and with intensity or colours now and then."""
    import pye57

    draw = Draw(rng)
    parts, clouds = [], []
    for _ in range(draw.one("scans", 1, 1, 3)):
        points = draw.points()
        data = {f"cartesian{axis}": points[:, k].copy() for k, axis in enumerate("XYZ")}
        if draw.maybe("intensity"):
            data["intensity"] = rng.uniform(0, 1, 40)
        if draw.maybe("colours"):
            data |= {f"color{name}": rng.integers(0, 256, 40).astype(np.uint8) for name in ("Red", "Green", "Blue")}
        turned = draw.maybe("pose")
        half, place = rng.uniform(0, np.pi), rng.uniform(-5, 5, 3)
        parts.append(
            (data, np.array([np.cos(half), 0, 0, np.sin(half)]) if turned else np.array([1.0, 0, 0, 0]), place * turned)
        )
        a = 2 * half * turned
        turn = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
        clouds.append(points @ turn.T + place * turned)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scan.e57"
        with pye57.E57(str(path), mode="w") as file:
            for data, turn, place in parts:
                file.write_scan_raw(data, name="scan", rotation=turn, translation=place)
        return Written({".e57": path.read_bytes()}, np.vstack(clouds), draw.ways)
