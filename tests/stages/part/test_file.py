"""Parts from mesh files: safe repairs are made and told, everything else is refused with the place and the remedy."""

from __future__ import annotations

import functools
import os
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from damageest.artefacts import open_edges
from damageest.errors import InputError
from damageest.geometry.healing import heal
from damageest.geometry.make_part import make_part
from damageest.stages.part.file import PartFile

quick = settings(
    max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def box(size=10.0, at=(0.0, 0, 0)):
    mesh = trimesh.creation.box(extents=(size,) * 3)
    mesh.apply_translation(at)
    return mesh


def inverted(mesh):
    copy = mesh.copy()
    copy.invert()
    return copy


def joined(*meshes):
    mesh = trimesh.util.concatenate(meshes)
    return mesh.vertices, mesh.faces


def soup(mesh):
    return mesh.triangles.reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3)


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


SPOILED = {
    "inside out": ((box().vertices, box().faces[:, ::-1]), 1000, "reversed all triangles"),
    "some windings": (
        (box().vertices, np.where(np.isin(np.arange(12), [3, 7])[:, None], box().faces[:, ::-1], box().faces)),
        1000,
        "reversed 2 triangles",
    ),
    "a triangle missing": ((box().vertices, box().faces[1:]), 1000, "closed 1 small hole with 1 triangle"),
    "a repeated corner": (
        (box().vertices, np.vstack([box().faces, [[0, 0, 1]]])), 1000, "dropped 1 triangles with a repeated corner",
    ),
    "every face twice": ((box().vertices, np.concatenate([box().faces] * 2)), 1000, "dropped 12 triangles"),
    "both sides": (
        (box().vertices, np.concatenate([box().faces, box().faces[:, ::-1]])), 1000, "dropped 12 triangles",
    ),
    "two bodies": (joined(box(), box(10, (30, 0, 0))), 2000, "2 separate bodies"),
    "one of them inside out": (joined(box(), inverted(box(10, (30, 0, 0)))), 2000, "triangles of 1 of 2 bodies"),
    "overlapping": (joined(box(), box(10, (5, 1, 1))), 2000 - 5 * 9 * 9, "united 2 bodies"),
    "face to face": (joined(box(), box(10, (10, 0, 0))), 2000, "united 2 bodies"),
    "one in the other": (joined(box(), box(4)), 1000, "united 2 bodies"),
    "a cavity": (joined(box(), inverted(box(4))), 1000 - 64, "1 inner cavity, kept"),
    "a cavity, all inside out": (joined(inverted(box()), box(4)), 1000 - 64, "reversed all triangles"),
    "an island in a cavity": (joined(box(), inverted(box(6)), box(2)), 1000 - 216 + 8, "1 inner cavity, kept"),
}  # fmt: skip


@pytest.mark.parametrize("name", sorted(SPOILED))
def test_safe_repairs_restore_the_solid_and_say_so(name):
    (vertices, faces), volume, note = SPOILED[name]
    part = make_part(vertices, faces)
    assert part.volume == pytest.approx(volume)
    assert any(note in said for said in part.notes), part.notes


def test_boxes_that_share_an_edge_keep_both_volumes():
    mesh = trimesh.util.concatenate([box(), box(10, (10, 10, 0))])
    mesh.merge_vertices()
    assert open_edges(mesh.faces)
    assert make_part(mesh.vertices, mesh.faces).volume == pytest.approx(2000)


@given(seed=st.integers(0, 10**6), holes=st.integers(1, 8))
@quick
def test_a_sphere_shuffled_jittered_turned_and_pierced_is_a_sphere_again(seed, holes):
    rng = np.random.default_rng(seed)
    mesh = trimesh.creation.icosphere(3, radius=5)
    vertices, faces = soup(mesh)
    vertices = vertices + rng.uniform(-1e-7, 1e-7, vertices.shape)
    faces = rng.permutation(faces)[holes:]
    turned = rng.random(len(faces)) < 0.4
    faces = np.where(turned[:, None], faces[:, ::-1], faces)
    healed_vertices, healed_faces, notes = heal(vertices, faces)
    assert not open_edges(healed_faces)
    corners = healed_vertices[healed_faces]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume == pytest.approx(mesh.volume, rel=0.01)
    assert len(notes) >= 2


def test_what_is_given_is_not_changed():
    vertices, faces = soup(box())
    kept = vertices.copy(), faces.copy()
    vertices.flags.writeable = faces.flags.writeable = False
    heal(vertices, faces[:, ::-1])
    np.testing.assert_array_equal(vertices, kept[0])
    np.testing.assert_array_equal(faces, kept[1])


def test_an_open_box_is_refused_with_count_place_and_remedy():
    mesh = box()
    faces = mesh.faces[mesh.face_normals[:, 2] < 0.5]
    with pytest.raises(InputError, match=r"4 open edges.*, 5\).*Export the part again") as error:
        make_part(mesh.vertices, faces, path="lid.stl")
    assert str(error.value).startswith("lid.stl: not watertight")


def test_a_fin_on_a_box_is_refused_as_non_manifold():
    mesh = box()
    vertices = np.vstack([mesh.vertices, [[20.0, 0, 0]]])
    edge = mesh.faces[0][:2]
    with pytest.raises(InputError, match="1 edges with more than two triangles"):
        make_part(vertices, np.vstack([mesh.faces, [[edge[0], edge[1], 8]]]))


def test_a_moebius_strip_is_refused_as_one_sided():
    n = 30
    turn = np.linspace(0, 2 * np.pi, n, endpoint=False)
    half = turn / 2
    rim = [
        np.column_stack(
            [(3 + s * np.cos(half)) * np.cos(turn), (3 + s * np.cos(half)) * np.sin(turn), s * np.sin(half)]
        )
        for s in (-1, 1)
    ]
    vertices = np.concatenate(rim)
    faces = []
    for i in range(n):
        a, b = i, i + n
        c, d = ((i + 1), (i + 1) + n) if i + 1 < n else (n, 0)
        faces += [[a, c, b], [b, c, d]]
    with pytest.raises(InputError, match="one-sided"):
        make_part(vertices, np.array(faces))


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("empty.stl", b"", "empty"),
        ("page.stl", b"<html><body>404</body></html>", "web page"),
        ("short.stl", bytes(80) + (12).to_bytes(4, "little") + bytes(300), "cut short"),
        ("noise.stl", bytes(range(256)) * 4, "cut short"),
        ("text.stl", b"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0\n", "cut short"),
        ("none.ply", b"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n", "none.ply"),
        ("bad.3mf", b"PK\x03\x04 not a zip", "not a readable .3mf"),
        ("bad.obj", b"v 0 0 zero\nf 1 2 3\n", "bad.obj"),
        ("part.step", b"ISO-10303-21;", "'.step' is not a suffix"),
    ],
)
def test_what_is_no_mesh_is_refused_with_name_and_valid_suffixes(name, content, says, tmp_path):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=says) as error:
        PartFile(path=tmp_path / name).run(unit="mm")
    assert name in str(error.value)


def test_missing_files_and_folders_are_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.stl: no such file; .*\.3mf"):
        PartFile(path=tmp_path / "nowhere.stl").run(unit="mm")
    with pytest.raises(InputError, match="is a folder"):
        PartFile(path=tmp_path).run(unit="mm")


def test_nan_and_flat_parts_are_refused():
    vertices = box().vertices.copy()
    vertices[0, 0] = np.nan
    with pytest.raises(InputError, match="not finite"):
        make_part(vertices, box().faces)
    with pytest.raises(InputError, match="no volume"):
        make_part(box().vertices * [1, 1, 0], box().faces)
    with pytest.raises(InputError, match="repair"):
        make_part(box().vertices, box().faces[1:], repair=False)


@functools.cache
def sound_file(suffix):
    if suffix == ".obj":
        return b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
    what = trimesh.Scene({"part": box(1)}) if suffix == ".3mf" else box(1)
    content = what.export(file_type=suffix[1:])
    return content.encode() if isinstance(content, str) else content


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj", ".off", ".3mf"])
@given(data=st.data())
@quick
def test_damaged_bytes_raise_nothing_but_input_errors(suffix, data, tmp_path):
    whole = bytearray(sound_file(suffix))
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
