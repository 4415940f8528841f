"""PLY, text or binary with either byte order. Other properties than x, y, z and the normal are ignored."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from damageest.artefacts import Floats
from damageest.io.points import FormatError, PointFile
from damageest.io.points.text import parse_numbers

TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"},
    **{"int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8"},
}


@dataclass
class _Element:
    name: str
    count: int
    properties: list[tuple[str, str]] = field(default_factory=list)
    lists: list[tuple[int, str, str]] = field(
        default_factory=list
    )  # (position among the properties, type of the count, type of the items)


def read_header(data: bytes) -> tuple[str, list[_Element], int]:
    """The name of the format, the elements, and the position of the first byte after the header."""
    if not data.startswith(b"ply"):
        raise FormatError("not a PLY file: it does not start with 'ply'")
    end = data.find(b"end_header")
    newline = data.find(b"\n", end)
    if end < 0 or newline < 0:
        raise FormatError("the PLY header has no end_header; the file may be truncated")
    form, elements = "", list[_Element]()
    for line in data[:end].decode("latin-1").splitlines()[1:]:
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        try:
            if words[0] == "format":
                form = words[1]
            elif words[0] == "element":
                elements.append(_Element(words[1], int(words[2])))
            elif words[0] == "property" and words[1] == "list":
                elements[-1].lists.append((len(elements[-1].properties), TYPES[words[2]], TYPES[words[3]]))
            elif words[0] == "property":
                elements[-1].properties.append((words[2], TYPES[words[1]]))
            else:
                raise KeyError(words[0])
        except (IndexError, ValueError, KeyError):
            raise FormatError(f"a line of the PLY header is not valid: '{line.strip()[:60]}'") from None
    if form not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise FormatError(f"the PLY format '{form}' is unknown")
    return form, elements, newline + 1


def read(path: Path, columns: str | None = None) -> PointFile:
    """The properties x, y, z and, if present, nx, ny, nz of the element 'vertex'."""
    data = path.read_bytes()
    form, elements, start = read_header(data)
    order = [e.name for e in elements]
    if "vertex" not in order:
        raise FormatError("the PLY file has no element 'vertex'")
    vertex = elements[order.index("vertex")]
    names = [name for name, _ in vertex.properties]
    if not {"x", "y", "z"} <= set(names):
        raise FormatError(
            f"the vertices of the PLY file have no x, y, z; their properties are: {', '.join(names) or 'none'}"
        )
    if vertex.lists:
        raise FormatError("the vertices of the PLY file have list properties, which are not supported")
    before = elements[: order.index("vertex")]
    read_body = _read_text if form == "ascii" else _read_binary
    found = read_body(data, start, before, vertex, ">" if form == "binary_big_endian" else "<")

    def stack(*which: str) -> Floats:
        out = np.empty((vertex.count, 3))
        for k, name in enumerate(which):
            out[:, k] = found[name]
        return out

    normals = stack("nx", "ny", "nz") if {"nx", "ny", "nz"} <= set(names) else None
    return PointFile(stack("x", "y", "z"), normals)


def make_dtype(element: _Element, order: str) -> np.dtype[np.void]:
    try:
        return np.dtype([(name, order + kind) for name, kind in element.properties])
    except ValueError:
        raise FormatError("two properties of the PLY file have the same name") from None


def _read_binary(
    data: bytes, start: int, before: list[_Element], vertex: _Element, order: str
) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    for element in before:
        if not element.lists:
            start += element.count * make_dtype(element, order).itemsize
        elif element.properties or len(element.lists) > 1:
            raise FormatError(
                f"the PLY element '{element.name}' before the vertices has lists and values, which is not supported"
            )
        else:
            _, counter, item = element.lists[0]
            size, width = np.dtype(counter).itemsize, np.dtype(item).itemsize
            way = "little" if order == "<" else "big"
            for _ in range(element.count):
                if start + size > len(data):
                    raise FormatError("the PLY file is truncated")
                start += size + width * int.from_bytes(data[start : start + size], way)  # type: ignore[arg-type]
    kind = make_dtype(vertex, order)
    have = (len(data) - start) // kind.itemsize
    if vertex.count < 0 or have < vertex.count:
        raise FormatError(f"the PLY file is truncated: it has {max(have, 0)} of {vertex.count} vertices")
    return np.frombuffer(data, kind, vertex.count, start)


def _read_text(data: bytes, start: int, before: list[_Element], vertex: _Element, order: str) -> dict[str, Floats]:
    skip = sum(e.count for e in before)
    for _ in range(skip):
        start = data.find(b"\n", start) + 1
        if not start:
            raise FormatError("the PLY file is truncated")
    width, wanted = len(vertex.properties), vertex.count
    if wanted * width * 2 > len(data) - start + 1:
        raise FormatError(f"the PLY file is truncated: it is too small for the {wanted} vertices in its header")
    rest = data[start:]
    if vertex is not None and rest.count(b"\n") > wanted:  # faces follow: keep the lines of the vertices only
        rest = _take_lines(rest, wanted)
    values = parse_numbers(rest)
    if len(values) < wanted * width:
        raise FormatError(f"the PLY file is truncated: it has {len(values) // width} of {wanted} vertices")
    table = values[: wanted * width].reshape(wanted, width)
    return {name: table[:, k] for k, (name, _) in enumerate(vertex.properties)}


def _take_lines(data: bytes, count: int) -> bytes:
    ends = np.flatnonzero(np.frombuffer(data, np.uint8) == ord("\n"))
    return data[: int(ends[count - 1]) + 1] if count else b""
