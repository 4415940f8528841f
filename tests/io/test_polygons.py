"""Parts whose files have faces of more than three corners: area and volume are those of the part, and it is said."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from damageest.errors import InputError
from damageest.io.parts import read_part

OUTLINE = [(0, 0), (60, 0), (60, 12), (14, 12), (14, 40), (0, 40)]
VERTICES = [(x, y, z) for y in (0, 45) for x, z in OUTLINE]
FACES = [
    [1, 2, 3, 4, 5, 0], [10, 9, 8, 7, 6, 11], [1, 0, 6, 7], [2, 1, 7, 8],
    [3, 2, 8, 9], [4, 3, 9, 10], [5, 4, 10, 11], [0, 5, 11, 6],
]  # fmt: skip
"""A bracket of an L: its two faces of six corners are concave."""
MARKS = {"binary_little_endian": "<", "binary_big_endian": ">"}


def write_obj(word: str, join: str = " ") -> bytes:
    lines = ["v {} {} {}".format(*vertex) for vertex in VERTICES]
    faces = [join.join(["f", *(word.format(n=n + 1, back=n - 12) for n in face)]) for face in FACES]
    return "\n".join([*lines, "vn 0 0 1", "vt 0 0", *faces, ""]).encode()


def write_off(head: str, tail: str) -> bytes:
    faces = [" ".join(map(str, [len(face), *face])) + tail for face in FACES]
    return "\n".join([head, *("{} {} {}".format(*vertex) for vertex in VERTICES), *faces, ""]).encode()


def write_ply(form: str, more: bool) -> bytes:
    """``more``: a value before the corners, a list and a value after them, and another element in front."""
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    before, after = "property uchar red\n", "property list uchar float texcoord\nproperty float q\n"
    kind = "element kind 2\nproperty list int short tags\nproperty uchar n\n" if more else ""
    head = f"ply\nformat {form} 1.0\n{kind}element vertex 12\n{axes}element face 8\n{before if more else ''}"
    head += f"property list uchar int vertex_indices\n{after if more else ''}end_header\n"
    rows: list[tuple[str, list[float]]] = []
    if more:
        rows += [("i2hB", [2, 7, 8, 9]), ("iB", [0, 1])]
    rows += [("3f", list(vertex)) for vertex in VERTICES]
    for face in FACES:
        code, row = f"B{len(face)}i", [len(face), *face]
        rows.append((f"B{code}B2ff", [200, *row, 2, 0.5, 0.5, 1.5]) if more else (code, list(row)))
    if form == "ascii":
        return (head + "".join(" ".join(map(str, row)) + "\n" for _, row in rows)).encode()
    return head.encode() + b"".join(struct.pack(MARKS[form] + code, *row) for code, row in rows)


FILES = {
    "a.obj": write_obj("{n}"),
    "textures.obj": write_obj("{n}/1/1"),
    "relative.obj": write_obj("{back}//1"),
    "continued.obj": write_obj("{n}", " \\\n "),
    "a.off": write_off("OFF\n# a comment\n12 8 0", ""),
    "colours.off": write_off("OFF 12 8 0", " 1 0 0"),
    **{f"{form}{int(more)}.ply": write_ply(form, more) for form in ("ascii", *MARKS) for more in (False, True)},
}


@pytest.mark.parametrize("name", FILES)
def test_concave_faces_are_divided(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(FILES[name])
    part = read_part(tmp_path / name, "mm")
    assert part.volume == pytest.approx(50040)
    assert part.area == pytest.approx(11224)
    assert any("8 of 8 faces have more than three corners" in note and "2 of them" in note for note in part.notes)


@pytest.mark.parametrize("name", ["a.obj", "a.off", "binary_little_endian0.ply", "ascii0.ply"])
def test_a_corner_that_is_not_there_is_refused(name: str, tmp_path: Path) -> None:
    data = FILES[name]
    wrong = data.replace(struct.pack("<B4i", 4, 3, 2, 8, 9), struct.pack("<B4i", 4, 3, 2, 8, 99))
    wrong = wrong.replace(b"f 4 3 9 10\n", b"f 4 3 9 100\n").replace(b"4 3 2 8 9\n", b"4 3 2 8 99\n")
    assert wrong != data
    (tmp_path / name).write_bytes(wrong)
    with pytest.raises(InputError, match="refers to a vertex that is not in the file"):
        read_part(tmp_path / name, "mm")


def test_triangles_are_read_as_before(tmp_path: Path) -> None:
    lines = ["v 0 0 0", "v 1 0 0", "v 0 1 0", "v 0 0 1", "f 1 3 2", "f 1 2 4", "f 1 4 3", "f 2 3 4", ""]
    (tmp_path / "part.obj").write_text("\n".join(lines))
    part = read_part(tmp_path / "part.obj", "mm")
    assert part.volume == pytest.approx(1 / 6)
    assert np.array_equal(part.faces, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    assert not part.notes


def test_strips_of_triangles_turn_every_second_one(tmp_path: Path) -> None:
    """A tetrahedron in one strip of three triangles, and another of one."""
    head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    head += "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    rows = ["0 0 0", "1 0 0", "0 1 0", "0 0 1", "9 0 2 1 3 0 -1 0 3 2", ""]
    (tmp_path / "part.ply").write_text(head + "\n".join(rows))
    part = read_part(tmp_path / "part.ply", "mm")
    assert part.volume == pytest.approx(1 / 6)
