"""Which columns of a text are x, y and z: by their names, by their values, and by the part's size; and it is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from damageest.artefacts import Part, Scan
from damageest.errors import InputError
from damageest.io.points import FormatError, text
from damageest.io.points.text_columns import name_columns
from damageest.pipeline.placing.prepare import choose_columns, measure_scan
from damageest.stages.scan.file import ScanFile
from tests.geometry.shapes import box
from tests.io.test_text_as_others_write_it import write

RNG = np.random.default_rng(3)
POINTS = RNG.uniform(-30, 30, (50, 3)).round(4)
NORMALS = np.array([[0.0, 0.0, 1.0], [0.6, 0.8, 0.0], [0.0, -1.0, 0.0]])[RNG.integers(0, 3, 50)]
COUNT = np.arange(1, 51)[:, None]


def rows(*columns: np.ndarray) -> list[str]:
    return [" ".join(f"{value:.10g}" for value in row) for row in np.hstack(columns)]


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (rows(COUNT, POINTS), "2, 3, 4 of 4, since the first column counts the points"),
        (rows(COUNT - 1, POINTS, NORMALS), "2, 3, 4 of 7, normals 5, 6, 7, since the first column counts"),
        (rows(NORMALS, POINTS), "4, 5, 6 of 6, normals 1, 2, 3, since the first three columns have the length 1"),
        (rows(POINTS, COUNT % 7), "1, 2, 3 of 4, since nothing names the columns"),
        (['"x" "y" "z"', *(f'"{row}'.replace(" ", '" ', 1) for row in rows(COUNT, POINTS))], "2, 3, 4 of 4, by their"),
        ([",x,y,z", *(row.replace(" ", ",") for row in rows(COUNT, POINTS))], "2, 3, 4 of 4, by their names"),
        (["Point ID;X [mm];Y [mm];Z [mm]", *(row.replace(" ", ";") for row in rows(COUNT, POINTS))], "2, 3, 4 of 4"),
        (["# made on axes x y z by somebody", "#X Y Z I", *rows(POINTS, COUNT % 7)], "1, 2, 3 of 4, by their names"),
        (["x,y,i,z", *(f"{a},{b},,{c}" for a, b, c in POINTS)], "1, 2, 4 of 4, by their names"),
    ],
)  # fmt: skip
def test_points_are_found_and_it_is_said_where(lines: list[str], says: str, tmp_path: Path) -> None:
    found = text.read(write(tmp_path / "scan.txt", lines))
    np.testing.assert_allclose(found.points, POINTS, atol=1e-9)
    assert says in found.columns
    assert (found.normals is not None) == ("normals" in says)


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (["x y z", *rows(POINTS, COUNT % 7)], "3 columns are named, but the rows have 4"),
        (["12,0711,-3,5,4,25", "13,0500,-3,6,4,75"], "the comma separates columns, and seems to be the decimal point"),
    ],
)
def test_what_cannot_be_told_is_refused(lines: list[str], says: str, tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=says):
        text.read(write(tmp_path / "scan.txt", lines))


@pytest.mark.parametrize(
    "line",
    ["X,Y,Z", "x y z", "X_Coordinate;Y_Coordinate;Z_Coordinate", "Position X\tPosition Y\tPosition Z", "//X Y Z"[2:],
     "Points_0,Points_1,Points_2", "x (mm),y (mm),z (mm)", "X-axis,Y-axis,Z-axis", "coords:x;coords:y;coords:z"],
)  # fmt: skip
def test_names_that_programs_give(line: str) -> None:
    assert name_columns(line) == ["x", "y", "z"]


def choose(lines: list[str], folder: Path) -> tuple[Scan, str]:
    """The scan that a part of a cube 60 wide chooses, and what is printed of it."""
    reader = ScanFile(path=write(folder / "scan.txt", lines))
    cube = box(60.0)
    part = Part(cube.vertices, cube.faces)
    scan = choose_columns(reader.run(unit="mm"), part, reader, "mm")
    measure_scan(scan, part, None)
    return scan, " ".join(map(str, scan.warnings))


def test_columns_without_names_are_chosen_by_the_size_of_the_part(tmp_path: Path) -> None:
    row_and_column = np.column_stack([1000 * (np.arange(50) // 7), 900 * (np.arange(50) % 7)])
    scan, told = choose(rows(row_and_column, POINTS), tmp_path)
    np.testing.assert_allclose(scan.points, POINTS, atol=1e-9)
    assert "x, y, z are columns 1, 2, 3 of 5" in told
    assert "'_ _ x y z'" in told
    assert "scan.columns" in told


def test_columns_that_may_be_meant_in_two_ways_are_asked_for(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"columns: '_ x y z _ _ _', or .*columns: '_ _ _ _ x y z'"):
        choose(rows(1e4 * RNG.uniform(size=(50, 1)), POINTS, 0.7 * POINTS), tmp_path)


def test_a_scan_of_another_size_says_which_columns_were_taken(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="x, y, z are columns 1, 2, 3 of 4, since nothing names the columns"):
        choose(rows(1000 * POINTS, 1000 * POINTS[:, :1]), tmp_path)
