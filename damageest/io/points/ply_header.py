"""The header of a PLY file."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

from damageest.io.points import FormatError

TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"},
    **{"int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8"},
}
LONGEST_HEADER = 1 << 20
"""Bytes of a header at most."""


@dataclass(frozen=True)
class ListProperty:
    """A list of an element: in front of which of its properties it stands, the types of its count and items."""

    name: str
    place: int
    counter: str
    item: str


@dataclass
class Element:
    """An element of the header: its properties (name, type), and its lists."""

    name: str
    count: int
    properties: list[tuple[str, str]] = field(default_factory=list)
    lists: list[ListProperty] = field(default_factory=list)


@dataclass(frozen=True)
class Header:
    """The name of the format, the elements, the comments, and the position of the first byte after the header."""

    form: str
    elements: list[Element]
    comments: tuple[str, ...]
    end: int

    @property
    def order(self) -> str:
        """The byte order, as numpy names it."""
        return ">" if self.form == "binary_big_endian" else "<"

    @property
    def vertex(self) -> Element:
        """The element 'vertex'. Raises FormatError where there is none, or none with coordinates."""
        vertex = next((one for one in self.elements if one.name == "vertex"), None)
        if vertex is None:
            raise FormatError("the PLY file has no element 'vertex'")
        names = [name for name, _ in vertex.properties]
        if not {"x", "y", "z"} <= set(names):
            raise FormatError(
                f"the vertices of the PLY file have no x, y, z; their properties are: {', '.join(names) or 'none'}"
            )
        if vertex.lists:
            raise FormatError("the vertices of the PLY file have list properties, which are not supported")
        return vertex

    @property
    def before(self) -> list[Element]:
        """The elements in front of the vertices."""
        names = [one.name for one in self.elements]
        return self.elements[: names.index("vertex")]


def read_header(path: Path) -> Header:
    """The header of a file. Raises FormatError where it is not valid."""
    with path.open("rb") as stream:
        data = stream.read(LONGEST_HEADER)
    if not data.startswith(b"ply"):
        raise FormatError("not a PLY file: it does not start with 'ply'")
    end = data.find(b"end_header")
    newline = data.find(b"\n", end)
    if end < 0 or newline < 0:
        raise FormatError("the PLY header has no end_header; the file may be truncated")
    form, elements, comments = "", list[Element](), list[str]()
    # not splitlines: of a comment in UTF-8, a byte may be what Latin-1 calls an end of line
    for line in re.split(r"\r\n|\n|\r", data[:end].decode("latin-1"))[1:]:
        words = line.split()
        if not words:
            continue
        if words[0] in ("comment", "obj_info"):
            comments.append(line.strip().partition(" ")[2])
            continue
        try:
            if words[0] == "format":
                form = words[1]
            elif words[0] == "element":
                elements.append(Element(words[1], int(words[2])))
            elif words[0] == "property" and words[1] == "list":
                place, kinds = len(elements[-1].properties), (TYPES[words[2]], TYPES[words[3]])
                elements[-1].lists.append(ListProperty(words[4], place, *kinds))
            elif words[0] == "property":
                elements[-1].properties.append((words[2], TYPES[words[1]]))
            else:
                raise KeyError(words[0])
        except (IndexError, ValueError, KeyError):
            raise FormatError(f"a line of the PLY header is not valid: '{line.strip()[:60]}'") from None
    if form not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise FormatError(f"the PLY format '{form}' is unknown")
    return Header(form, elements, tuple(comments), newline + 1)
