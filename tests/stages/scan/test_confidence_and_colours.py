"""What scanners write beside coordinates: confidence, by which points may be set aside, and colours, which stay."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import damageest
from damageest.errors import InputError
from damageest.io.meshes import write_points
from damageest.io.points import read_points, streams
from damageest.output.folder import open_output
from damageest.stages.scan.file import ScanFile
from tests import damaged_box

rng = np.random.default_rng(0)
CLOUD = rng.normal(size=(400, 3)).astype(np.float32)
CONFIDENCE = rng.random(400).astype(np.float32)
COLOURS = rng.integers(0, 256, (400, 3)).astype(np.uint8)


def write(path: Path, name: str | None = "quality", coloured: bool = True, order: Any = slice(None)) -> Path:
    """A cloud as PLY with a confidence of that name."""
    columns = dict(zip("xyz", CLOUD[order].T, strict=True))
    if coloured:
        columns |= dict(zip(("red", "green", "blue"), COLOURS[order].T, strict=True))
    if name:
        columns[name] = CONFIDENCE[order]
    write_points(path, columns)
    return path


def write_text(path: Path, *_: Any) -> Path:
    rows = np.column_stack([CLOUD, CONFIDENCE, COLOURS])
    np.savetxt(path, rows, fmt=["%.9g"] * 4 + ["%d"] * 3, header="X Y Z Scalar_Quality R G B", comments="//")
    return path


def write_pcd(path: Path, *_: Any) -> Path:
    head = "VERSION 0.7\nFIELDS x y z rgb confidence\nSIZE 4 4 4 4 4\nTYPE F F F F F\nCOUNT 1 1 1 1 1\n"
    packed = (COLOURS.astype(np.uint32) @ np.array([65536, 256, 1], np.uint32)).view(np.float32)
    rows = np.column_stack([CLOUD, packed, CONFIDENCE]).astype("<f4")
    head += f"WIDTH {len(rows)}\nHEIGHT 1\nPOINTS {len(rows)}\nDATA binary\n"
    path.write_bytes(head.encode() + rows.tobytes())
    return path


@pytest.mark.parametrize("name", ["quality", "confidence", "scalar_quality", "scalar_Confidence"])
def test_confidence_is_found_by_the_names_that_programs_give_it(tmp_path: Path, name: str) -> None:
    scan = ScanFile(path=write(tmp_path / "a.ply", name)).run("mm")
    assert (scan.confidence == CONFIDENCE).all()
    assert len(scan.points) == 400, "nothing is set aside unless the job says so"
    assert any("400 points have a confidence" in note and "none is set aside" in note for note in scan.notes)


@pytest.mark.parametrize(("suffix", "make"), [("ply", write), ("txt", write_text), ("pcd", write_pcd)])
def test_points_below_the_least_confidence_are_set_aside_and_counted(tmp_path: Path, suffix: str, make: Any) -> None:
    scan = ScanFile(path=make(tmp_path / f"a.{suffix}"), min_confidence=0.25).run("mm")
    kept = CONFIDENCE >= 0.25
    assert scan.points == pytest.approx(CLOUD[kept].astype(float))
    assert (scan.colours == COLOURS[kept]).all()
    (told,) = (one for one in scan.warnings if one.code == "low_confidence")
    assert told.amount == (~kept).sum()


def test_a_value_of_the_file_is_not_below_itself(tmp_path: Path) -> None:
    """0.7 in single precision is less than 0.7 in double precision."""
    write_points(tmp_path / "a.ply", {**dict(zip("xyz", CLOUD.T, strict=True)), "quality": np.full(400, 0.7, "f4")})
    assert len(ScanFile(path=tmp_path / "a.ply", min_confidence=0.7).run("mm").points) == 400


def test_no_confidence_to_set_points_aside_by(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a\.ply: no point has a confidence, .*quality"):
        ScanFile(path=write(tmp_path / "a.ply", None), min_confidence=0.5).run("mm")
    with pytest.raises(InputError, match="no point has a confidence of 2 or more; it is 0"):
        ScanFile(path=write(tmp_path / "a.ply"), min_confidence=2).run("mm")


def test_files_with_and_without(tmp_path: Path) -> None:
    first, second = slice(None, 200), slice(200, None)
    paths: Any = [write(tmp_path / "a.ply", None, False, first), write(tmp_path / "b.ply", order=second)]
    scan = ScanFile(path=paths, min_confidence=0.5).run("mm")
    kept = CONFIDENCE[second] >= 0.5
    assert (scan.colours == [[128] * 3] * 200 + COLOURS[second][kept].tolist()).all()
    assert np.isnan(scan.confidence[:200]).all()
    assert (scan.confidence[200:] == CONFIDENCE[second][kept]).all()
    assert "200 points without confidence are used" in scan.warnings[0].text


def test_the_same_of_a_scan_that_is_read_in_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(streams, "PIECE", 64)
    path = write(tmp_path / "a.ply")
    whole = read_points(path)
    scan = ScanFile(path=path, min_confidence=0.25, most_points=300).run("mm")
    assert scan.total == 400
    at = [int(np.flatnonzero((whole.points == point).all(axis=1))[0]) for point in scan.points]
    assert len(at) > 150
    assert (scan.colours == COLOURS[at]).all()
    assert (scan.confidence == CONFIDENCE[at]).all()
    assert scan.confidence.min() >= 0.25
    assert scan.warnings[0].amount == (CONFIDENCE < 0.25).sum()


@pytest.mark.slow
def test_colours_and_confidence_are_in_the_scan_that_is_written(tmp_path: Path) -> None:
    """Of each point, after a crop and the merge of two files with points in common."""
    points = damaged_box.scan(6000).astype(np.float32)
    colours = np.random.default_rng(1).integers(0, 256, points.shape).astype(np.uint8)
    quality = np.linspace(0, 1, len(points)).astype(np.float32)
    damaged_box.write_small(tmp_path)
    for name, some in (("a", slice(None, 4000)), ("b", slice(3000, None))):
        columns = dict(zip("xyz", points[some].T, strict=True)) | {"quality": quality[some]}
        write_points(
            tmp_path / f"{name}.ply", columns | dict(zip(("red", "green", "blue"), colours[some].T, strict=True))
        )
    crop = [{"drop": "above", "point": [0, 0, -5], "normal": [0, 0, -1]}]
    job: dict[str, Any] = {"version": 1, "tolerance": 0.4, "align": "none", "report": "none"}
    job |= {
        "part": str(tmp_path / "box.stl"),
        "scan": {"path": [str(tmp_path / f"{k}.ply") for k in "ab"], "crop": crop},
    }
    kept = points[:, 2] > -5
    out = tmp_path / "out"  # the second run takes the kept stages of the first
    for choice, names in (("label", ("scan_red", "scan_green", "scan_blue")), ("scan", ("red", "green", "blue"))):
        damageest.run(job | {"export": {"point_colours": choice}}, output=out)
        table = read_table(out / "scan.ply")
        assert (np.stack([table[axis] for axis in "xyz"], axis=1) == points[kept]).all()
        assert (np.stack([table[name] for name in names], axis=1) == colours[kept]).all()
        assert (table["confidence"] == quality[kept]).all()
        seen = open_output(out).scan
        assert seen is not None
        assert len(seen.points) == kept.sum()


def read_table(path: Path) -> Any:
    from damageest.io.points.ply import make_dtype
    from damageest.io.points.ply_header import read_header

    header = read_header(path)
    return np.frombuffer(path.read_bytes(), make_dtype(header.vertex, "<"), offset=header.end)


def test_colours_of_other_formats(tmp_path: Path) -> None:
    import laspy
    import pye57

    with pye57.E57(str(tmp_path / "a.e57"), mode="w") as file:
        data = {f"cartesian{axis}": CLOUD[:, k].astype(float) for k, axis in enumerate("XYZ")}
        data |= {f"color{name}": COLOURS[:, k] for k, name in enumerate(("Red", "Green", "Blue"))}
        file.write_scan_raw(data)
    las = laspy.create(point_format=2, file_version="1.2")
    las.header.scales = [1e-6] * 3
    las.x, las.y, las.z = CLOUD.T
    las.red, las.green, las.blue = COLOURS.T.astype(np.uint16) * 257
    las.write(tmp_path / "a.las")
    rows = np.column_stack([CLOUD, COLOURS / 255])
    (tmp_path / "a.obj").write_text(
        "".join("v {:.9g} {:.9g} {:.9g} {:.6f} {:.6f} {:.6f}\n".format(*row) for row in rows)
    )
    body = "".join(
        "{:.9g} {:.9g} {:.9g} 0.5 {:.0f} {:.0f} {:.0f}\n".format(*p, *c) for p, c in zip(CLOUD, COLOURS, strict=True)
    )
    (tmp_path / "a.ptx").write_text("20\n20\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n" + body)
    for suffix in ("e57", "las", "obj", "ptx"):
        assert (read_points(tmp_path / f"a.{suffix}").colours == COLOURS).all(), suffix
