"""Parts from mesh files of every format, and files that are refused with name and remedy."""

from __future__ import annotations

import functools
import os
from pathlib import Path

import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from damageest.errors import InputError
from damageest.stages.part.file import PartFile

quick = settings(
    max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def box(size=10.0, at=(0.0, 0, 0)):
    mesh = trimesh.creation.box(extents=(size,) * 3)
    mesh.apply_translation(at)
    return mesh


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj", ".off", ".3mf"])
def test_a_sphere_comes_back_from_every_format_without_repairs(suffix, tmp_path):
    mesh = trimesh.creation.icosphere(3, radius=7)
    path = tmp_path / f"part{suffix}"
    if suffix == ".obj":
        rows = ["v {!r} {!r} {!r}".format(*map(float, v)) for v in mesh.vertices]
        path.write_text("\n".join(rows + ["f {} {} {}".format(*(f + 1)) for f in mesh.faces]))
    elif suffix == ".3mf":
        trimesh.Scene({"part": mesh}).export(str(path))
    else:
        mesh.export(str(path))
    part = PartFile(path=path).run(unit="mm")
    assert part.volume == pytest.approx(mesh.volume, rel=1e-5)
    assert len(part.faces) == len(mesh.faces)
    assert part.path == str(path)
    assert len(part.sha256) == 64
    assert not part.notes


def test_text_stl_reads_like_binary(tmp_path):
    mesh = trimesh.creation.icosphere(2, radius=7)
    (tmp_path / "text.stl").write_text(trimesh.exchange.stl.export_stl_ascii(mesh))
    assert PartFile(path=tmp_path / "text.stl").run(unit="mm").volume == pytest.approx(mesh.volume, rel=1e-5)


def test_3mf_has_its_own_unit_and_places_all_its_bodies(tmp_path):
    scene = trimesh.Scene({"a": box(1), "b": box(1, (3, 0, 0))})
    scene.units = "mm"
    scene.export(str(tmp_path / "two.3mf"))
    text = PartFile(path=tmp_path / "two.3mf").run(unit="in")
    assert text.volume * 25.4**3 == pytest.approx(2.0, rel=1e-5)
    assert text.unit == "in"
    assert "converted from mm to in" in text.notes
    assert "2 separate bodies, kept as one part" in text.notes
    over = PartFile(path=tmp_path / "two.3mf", unit="cm").run(unit="mm")
    assert over.volume == pytest.approx(2000.0, rel=1e-5)


def test_a_file_without_unit_is_in_the_jobs_unless_told(tmp_path):
    box(1).export(str(tmp_path / "box.stl"))
    assert PartFile(path=tmp_path / "box.stl").run(unit="in").volume == pytest.approx(1)
    assert PartFile(path=tmp_path / "box.stl", unit="inch").run(unit="mm").volume == pytest.approx(25.4**3)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("empty.stl", b"", "empty"),
        ("page.stl", b"<html><body>404</body></html>", "web page"),
        ("short.stl", bytes(80) + (12).to_bytes(4, "little") + bytes(300), "truncated"),
        ("noise.stl", bytes(range(256)) * 4, "truncated"),
        ("text.stl", b"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0\n", "truncated"),
        ("none.ply", b"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n", "none.ply"),
        ("bad.3mf", b"PK\x03\x04 not a zip", "cannot be read as a .3mf"),
        ("bad.obj", b"v 0 0 zero\nf 1 2 3\n", "bad.obj"),
        ("part.step", b"ISO-10303-21;", "the format '.step' cannot be read"),
    ],
)
def test_what_is_no_mesh_is_refused_with_name_and_valid_suffixes(name, content, says, tmp_path):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=says) as error:
        PartFile(path=tmp_path / name).run(unit="mm")
    assert name in str(error.value)


def test_missing_files_and_folders_are_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.stl: there is no such file; .*\.3mf"):
        PartFile(path=tmp_path / "nowhere.stl").run(unit="mm")
    with pytest.raises(InputError, match="is a folder"):
        PartFile(path=tmp_path).run(unit="mm")


@functools.cache
def valid_file(suffix):
    if suffix == ".obj":
        return b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
    what = trimesh.Scene({"part": box(1)}) if suffix == ".3mf" else box(1)
    content = what.export(file_type=suffix[1:])
    return content.encode() if isinstance(content, str) else content


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj", ".off", ".3mf"])
@given(data=st.data())
@quick
def test_damaged_bytes_raise_nothing_but_input_errors(suffix, data, tmp_path):
    whole = bytearray(valid_file(suffix))
    if data.draw(st.booleans()):
        whole = bytearray(data.draw(st.binary(min_size=1, max_size=200)))
    at, cut = (int(data.draw(st.floats(0, 1, exclude_max=True)) * len(whole)) for _ in range(2))
    whole[at] = data.draw(st.integers(0, 255))
    path = tmp_path / f"part{suffix}"
    path.write_bytes(bytes(whole[: cut + 1] if data.draw(st.booleans()) else whole))
    try:
        assert PartFile(path=path).run(unit="mm").volume > 0
    except InputError as error:
        assert path.name in str(error)  # noqa: PT017


REAL = {"angle_block.STL": 1.1455, "featuretype.STL": 11.6277, "plate_holes.STL": 767362}


@pytest.mark.parametrize("name", sorted(REAL))
def test_real_files_are_solids(name, real_data):
    part = PartFile(path=real_data / name).run(unit="mm")
    assert part.volume == pytest.approx(REAL[name], rel=1e-4)


@pytest.fixture
def real_data():
    folder = os.environ.get("DAMAGEEST_REAL_DATA")
    if not folder:
        pytest.skip("DAMAGEEST_REAL_DATA does not name the folder of real inputs")
    return Path(folder)
