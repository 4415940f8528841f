"""Text and headers as other programs write them: read right, or refused with the reason."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from damageest.io.points import FormatError, pcd, ply, text

POINTS = np.array([[78.3252, -57.0711, 20.3804], [60.2749, -66.4361, 46.2302], [66.2228, -35.7341, 36.6939]])
NORMALS = np.array([[0.0, 0.0, 1.0], [0.6, 0.8, 0.0], [0.0, -1.0, 0.0]])


def write(path: Path, lines: list[str]) -> Path:
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def join(rows: np.ndarray, by: str = " ", form: str = "{:.4f}") -> list[str]:
    return [by.join(form.format(value) for value in row) for row in rows]


BOTH = np.hstack([NORMALS, POINTS])
VALID = {
    "header of words": ["Scanner: A", "Date: 2024-03-05", "Project: Repair 17", "Number of points: 3", *join(POINTS)],
    "decimal commas and tabs": [line.replace(".", ",") for line in join(POINTS, "\t")],
    "decimal commas and spaces": [line.replace(".", ",") for line in join(POINTS, "  ")],
    "decimal commas and semicolons": [line.replace(".", ",") for line in join(POINTS, ";")],
    "exponents of Fortran": [line.replace("E", "D") for line in join(POINTS, " ", "{:.6E}")],
    "names of ParaView": ['"Normals:0","Normals:1","Normals:2","Points:0","Points:1","Points:2"', *join(BOTH, ",")],
    "two scans with their counts": ["2", *join(POINTS[:2]), "1", *join(POINTS[2:])],
    "no number, as Windows writes it": [f"{line} {end}" for line, end in zip(
        join(POINTS), ["-nan(ind) -1.#IND 1.#QNAN", *join(NORMALS[1:])], strict=True)],
}  # fmt: skip


@pytest.mark.parametrize("kind", VALID)
def test_points_are_those_that_were_written(kind: str, tmp_path: Path) -> None:
    found = text.read(write(tmp_path / "scan.txt", VALID[kind]))
    np.testing.assert_allclose(found.points, POINTS, atol=1e-4)
    if kind == "names of ParaView":
        assert found.normals is not None
        np.testing.assert_allclose(found.normals, NORMALS, atol=1e-4)


@pytest.mark.parametrize(
    "lines",
    [
        ["1.0 2.0 abc", *join(POINTS)],
        [*join(POINTS), "1.0 2.0 abc"],
        ["only words", "and more of them"],
        [*join(POINTS), "1.0 2.0"],
    ],
)
def test_a_row_that_is_none_is_refused(lines: list[str], tmp_path: Path) -> None:
    with pytest.raises(FormatError):
        text.read(write(tmp_path / "scan.txt", lines))


def test_a_comment_in_utf_8_is_one_line(tmp_path: Path) -> None:
    head = "ply\nformat binary_little_endian 1.0\ncomment C:/Åke/del.png\nelement vertex 3\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    (tmp_path / "scan.ply").write_bytes(head.encode() + POINTS.astype("<f4").tobytes())
    np.testing.assert_allclose(ply.read(tmp_path / "scan.ply").points, POINTS, rtol=1e-6)


@pytest.mark.parametrize("extra", [1, 2])
def test_rows_longer_than_the_header_says_are_refused(extra: int, tmp_path: Path) -> None:
    head = ["ply", "format ascii 1.0", "element vertex 3", *(f"property float {axis}" for axis in "xyz"), "end_header"]
    lines = [*head, *join(np.hstack([POINTS, NORMALS[:, :extra]]))]
    with pytest.raises(FormatError, match="names 3 properties"):
        ply.read(write(tmp_path / "scan.ply", lines))


def test_padding_of_no_length_is_skipped(tmp_path: Path) -> None:
    head = "VERSION 0.7\nFIELDS x y z _ intensity _\nSIZE 4 4 4 1 4 1\nTYPE F F F U F U\nCOUNT 1 1 1 4 1 0\n"
    head += "WIDTH 3\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\nDATA binary\n"
    rows = b"".join(struct.pack("<fff4xf", *row, 1.0) for row in POINTS)
    (tmp_path / "scan.pcd").write_bytes(head.encode() + rows)
    np.testing.assert_allclose(pcd.read(tmp_path / "scan.pcd").points, POINTS, rtol=1e-6)
    (tmp_path / "scan.pcd").write_bytes(head.replace("COUNT 1", "COUNT 0").encode() + rows)
    with pytest.raises(FormatError):
        pcd.read(tmp_path / "scan.pcd")
