"""Formats of points with headers: PLY, PCD, NPY, LAS."""

from __future__ import annotations

import io
import struct

import numpy as np

from tests.io.writers.base import Draw, Rng, Written, box, split

KINDS = {
    "b": ("char", "int8"), "B": ("uchar", "uint8"), "h": ("short", "int16"), "H": ("ushort", "uint16"),
    "i": ("int", "int32"), "I": ("uint", "uint32"), "f": ("float", "float32"), "d": ("double", "float64"),
}  # fmt: skip


def write_ply(rng: Rng) -> Written:
    draw = Draw(rng)
    is_mesh = draw.maybe("faces")
    points, polygons = box() if is_mesh else (draw.points(), [])
    if is_mesh and draw.maybe("triangles"):
        polygons = [corner for face in polygons for corner in split(face)]
    form = draw.one("form", "ascii", "binary_little_endian", "binary_big_endian")
    order = ">" if form == "binary_big_endian" else "<"
    alias = draw.one("types", 0, 1)
    code = draw.one("coordinates", "f", "d")
    columns: list[tuple[str, str, list]] = [(axis, code, points[:, k].tolist()) for k, axis in enumerate("xyz")]
    normals = draw.normals(len(points)) if draw.maybe("normals", 0.3) else None
    if normals is not None:
        columns += [(f"n{axis}", "f", normals[:, k].tolist()) for k, axis in enumerate("xyz")]
    for name, kind in (("red", "B"), ("scalar_Original_cloud_index", "f"), ("material", "h"), ("time", "d")):
        if draw.maybe(name, 0.2):
            columns.append((name, kind, rng.integers(0, 100, len(points)).tolist()))
    if draw.maybe("columns in another order", 0.3):
        columns = [columns[k] for k in rng.permutation(len(columns))]
    space = draw.one("space", " ", " ", "  ")
    vertex = (
        ["element vertex " + str(len(points))],
        [f"property{space}{KINDS[k][alias]}{space}{n}" for n, k, _ in columns],
    )
    rows = [[(kind, values[n]) for _, kind, values in columns] for n in range(len(points))]
    counter, item = draw.one("counter", "B", "i", "H"), draw.one("item", "i", "I", "H", "h")
    listed = draw.one("list", "vertex_indices", "vertex_index")
    more = draw.maybe("values of faces", 0.3)
    face = ([f"element face {len(polygons)}"], [
        *(["property uchar flags"] if more else []),
        f"property list {KINDS[counter][alias]} {KINDS[item][alias]} {listed}",
        *(["property list uchar float texcoord"] if more else []),
    ])  # fmt: skip
    face_rows = [
        [
            *([("B", 1)] if more else []),
            (counter, len(p)),
            *((item, c) for c in p),
            *([("B", 2), ("f", 0.5), ("f", 1)] if more else []),
        ]
        for p in polygons
    ]
    elements = [(vertex, rows)]
    if is_mesh or draw.maybe("no faces, but named", 0.2):
        elements.append((face, face_rows))
    if draw.maybe("element in front", 0.2):
        other = (["element camera 2"], ["property float a", "property list uchar int b"])
        elements.insert(0, (other, [[("f", 1.5), ("B", 2), ("i", 3), ("i", 4)], [("f", 2.5), ("B", 0)]]))
    head = ["ply", f"format {form} 1.0"]
    if draw.maybe("comment in front of the format", 0.1):
        head.insert(1, "comment in front")
    for said in ("comment made by Å, x y z", "obj_info num_cols 4", "comment", "comment end of a header"):
        if draw.maybe(said, 0.3):
            head.append(said)
    for (first, properties), _ in elements:
        head += [*first, *properties]
    end = draw.one("end of line", "\n", "\n", "\r\n")
    data = (end.join([*head, "end_header"]) + end).encode(draw.one("code", "utf-8", "latin-1"))
    for _, all_rows in elements:
        for row in all_rows:
            if form == "ascii":
                data += (
                    " ".join(f"{v:.9g}" if k in "fd" else str(v) for k, v in row) + draw.rng.choice(["", " "]) + end
                ).encode()
            else:
                data += b"".join(struct.pack(order + k, v) for k, v in row)
    return Written({".ply": data}, points, draw.ways, error=1e-4, normals=normals, area=94.0 if is_mesh else 0.0)


def write_pcd(rng: Rng) -> Written:
    draw = Draw(rng)
    points = draw.points()
    coordinate = draw.one("coordinates", ("F", 4, "f"), ("F", 4, "f"), ("F", 8, "d"), ("I", 4, "i"))
    if coordinate[0] == "I":
        points = points.round()
    fields = [(axis, *coordinate, 1, [[v] for v in points[:, k].tolist()]) for k, axis in enumerate("xyz")]
    form = draw.one("form", "ascii", "binary", "binary_compressed")
    normals = draw.normals(40) if draw.maybe("normals", 0.3) else None
    if normals is not None:
        fields += [(f"normal_{a}", "F", 4, "f", 1, [[v] for v in normals[:, k].tolist()]) for k, a in enumerate("xyz")]
    if draw.maybe("rgb", 0.3):
        fields.append(("rgb", "U", 4, "I", 1, [[v] for v in rng.integers(0, 1 << 24, 40).tolist()]))
    if draw.maybe("descriptor", 0.3):
        fields.insert(int(rng.integers(0, 4)), ("fpfh", "F", 4, "f", 5, rng.uniform(0, 9, (40, 5)).tolist()))
    if draw.maybe("padding", 0.3):
        for at in (3, 1):
            fields.insert(at, ("_", "U", 1, "B", draw.one("bytes", 0, 4, 12), []))
        fields = [(*f[:5], [[0] * f[4]] * 40) if f[0] == "_" else f for f in fields]
    height = draw.one("height", 1, 1, 4)
    head = [f"VERSION {draw.one('version', '.7', '0.7', '.6')}", f"FIELDS {' '.join(f[0] for f in fields)}"]
    head += [f"SIZE {' '.join(str(f[2]) for f in fields)}", f"TYPE {' '.join(f[1] for f in fields)}"]
    if any(f[4] != 1 for f in fields) or draw.maybe("counts", 0.7):
        head.append(f"COUNT {' '.join(str(f[4]) for f in fields)}")
    head += [f"WIDTH {40 // height}", f"HEIGHT {height}"]
    if draw.maybe("view", 0.7):
        head.append("VIEWPOINT 0 0 0 1 0 0 0")
    head += ["POINTS 40", f"DATA {form}"]
    if draw.maybe("comment", 0.7):
        head.insert(0, draw.one("said", "# .PCD v0.7 - Point Cloud Data file format", "# Å"))
    end = draw.one("end of line", "\n", "\n", "\r\n")
    data = (end.join(head) + end).encode()
    if form == "ascii":
        for n in range(40):
            words = [f"{v:.9g}" for f in fields for v in f[5][n]]
            data += (" ".join(words) + end).encode()
    elif form == "binary":
        data += b"".join(struct.pack(f"<{f[4]}{f[3]}", *_whole(f, n)) for n in range(40) for f in fields)
    else:
        body = b"".join(struct.pack(f"<{f[4]}{f[3]}", *_whole(f, n)) for f in fields for n in range(40))
        packed = b"".join(bytes([len(body[k : k + 32]) - 1]) + body[k : k + 32] for k in range(0, len(body), 32))
        data += struct.pack("<II", len(packed), len(body)) + packed
    return Written({".pcd": data}, points, draw.ways, error=1e-4, normals=normals)


def _whole(field: tuple, row: int) -> list:
    return [int(v) for v in field[5][row]] if field[3] in "iIB" else field[5][row]


def write_npy(rng: Rng) -> Written:
    draw = Draw(rng)
    points, kind = draw.points(), draw.one("kind", "<f4", ">f4", "<f8", ">f8", "<i4", ">i2", "<i8")
    points = points.round() if kind[1] == "i" else points
    normals = draw.normals(40) if kind[1] == "f" and draw.maybe("normals") else None
    table = (points if normals is None else np.column_stack([points, normals])).astype(kind)
    stream = io.BytesIO()
    order = draw.one("order", "C", "F")
    np.lib.format.write_array(
        stream, np.asarray(table, order=order), version=draw.one("version", (1, 0), (2, 0), (3, 0))
    )
    return Written({".npy": stream.getvalue()}, points, draw.ways, normals=normals)


def write_las(rng: Rng) -> Written:
    """LAS 1.0 to 1.4 from its specification (ASPRS)."""
    draw = Draw(rng)
    points = draw.points()
    minor, kind = draw.one("version and format", (0, 0), (1, 1), (2, 0), (2, 1), (2, 2), (2, 3), (4, 6), (4, 7))
    scale, offset = draw.one("scale", 1e-4, 1e-5), rng.uniform(-100, 100, 3).round(2)
    extra = draw.one("extra bytes", 0, 0, 3)
    length = {0: 20, 1: 28, 2: 26, 3: 34, 6: 30, 7: 36}[kind] + extra
    head_size = 375 if minor == 4 else 227
    record = draw.maybe("record of variable length")
    vlr = struct.pack("<H16sHH32s", 0, b"somebody", 7, 5, b"a note") + b"12345" if record else b""
    start = head_size + len(vlr) + draw.one("gap", 0, 2)
    head = struct.pack("<4sHHIHH8sBB32s32sHHHIIBHI", b"LASF", 0, 0, 0, 0, 0, b"\0" * 8, 1, minor, b"system", b"program",
                       64, 2026, head_size, start, int(record), kind, length, 0 if minor == 4 else 40)  # fmt: skip
    head += struct.pack("<5I", *([0] * 5 if minor == 4 else [40, 0, 0, 0, 0])) + struct.pack(
        "<6d", *[scale] * 3, *offset
    )
    low, high = points.min(axis=0), points.max(axis=0)
    head += struct.pack("<6d", *(v for pair in zip(high, low, strict=True) for v in pair))
    if minor == 4:
        head += struct.pack("<QQIQ15Q", 0, 0, 0, 40, 40, *[0] * 14)
    body = b""
    for row in np.round((points - offset) / scale).astype(int).tolist():
        one = struct.pack("<iiiH", *row, 5)
        one += b"\x11" + b"\0" * (length - len(one) - 1)
        body += one
    data = head.ljust(head_size, b"\0") + vlr
    return Written({".las": data.ljust(start, b"\0") + body}, points, draw.ways, error=2 * scale)
