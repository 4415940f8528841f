"""Parts from arrays: what is kept, what a repair drops, and what the messages name."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.errors import InputError
from damageest.geometry.make_part import make_part
from tests.geometry.shapes import box

BOX = box()
BREP = {"faces_brep": np.arange(12) // 2, "face_names": tuple("abcdef"), "face_kinds": ("plane",) * 6}


def test_a_solid_stays_as_it_is_with_its_cad_faces() -> None:
    part = make_part(BOX.vertices, BOX.faces, "in", path="a.step", sha256="ab", notes=("read",), **BREP)
    assert np.array_equal(part.vertices, BOX.vertices)
    assert np.array_equal(part.faces, BOX.faces)
    assert (part.unit, part.path, part.sha256, part.notes) == ("in", "a.step", "ab", ("read",))
    assert part.faces_brep is not None
    assert part.faces_brep.tolist() == BREP["faces_brep"].tolist()
    assert part.face_names == BREP["face_names"]


def test_a_repair_that_keeps_the_surface_keeps_the_cad_faces() -> None:
    part = make_part(BOX.vertices, BOX.faces[:, ::-1], **BREP)
    assert part.volume == pytest.approx(1000)
    assert part.faces_brep is not None
    assert part.faces_brep.tolist() == BREP["faces_brep"].tolist()
    assert part.face_names == BREP["face_names"]


def test_a_repair_that_adds_a_surface_drops_the_cad_faces() -> None:
    pit = np.vstack(
        [BOX.vertices, [BOX.vertices[BOX.faces[0]].mean(axis=0) + 2 * BOX.cross[0] / np.linalg.norm(BOX.cross[0])]]
    )
    a, b, c = BOX.faces[0]
    roof = [[a, b, 8], [b, c, 8]]  # its third triangle is missing
    brep = {**BREP, "faces_brep": np.arange(13) // 2 % 6}
    part = make_part(pit, np.concatenate([BOX.faces[1:], roof]), **brep)
    assert part.volume > 1000
    assert part.faces_brep is None
    assert part.face_names == part.face_kinds == ()
    assert "CAD face" in part.notes[-1]


def test_faults_start_with_the_file() -> None:
    lidless = BOX.faces[BOX.cross[:, 2] < 1]
    with pytest.raises(InputError, match=r"^lid\.stl: not watertight"):
        make_part(BOX.vertices, lidless, path="lid.stl")
    with pytest.raises(InputError, match=r"^the part: encloses no volume"):
        make_part(BOX.vertices * [1, 1, 0], BOX.faces)


def test_without_repair_an_open_mesh_is_refused_with_the_option_to_set() -> None:
    with pytest.raises(InputError, match="set repair: true"):
        make_part(BOX.vertices, BOX.faces[1:], repair=False)
    assert make_part(BOX.vertices, BOX.faces[1:]).volume == pytest.approx(1000)


def test_arrays_of_the_wrong_shape_or_index_are_refused() -> None:
    with pytest.raises(InputError, match=r"expected vertices \(V,3\)"):
        make_part(BOX.vertices[:, :2], BOX.faces)
    with pytest.raises(InputError, match="outside the 8 vertices"):
        make_part(BOX.vertices, BOX.faces + 1)
    with pytest.raises(InputError, match="the part: "):
        make_part([["one", "two", "three"]], BOX.faces)
