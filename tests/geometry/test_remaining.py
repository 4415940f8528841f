"""What is left of a part where something is taken off: all of it but that, and nothing over the opening."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import damageest
from damageest.artefacts import Deposit, Floats, Mesh, Part, Solid
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.remaining import lift_faces, subtract_from_part
from damageest.geometry.skin import find_inner_faces
from damageest.geometry.solids import to_manifold, to_solid
from damageest.stages.allowance.milling import Milling
from tests.geometry.shapes import ball, box

SHRUNK = 2e-5


def find_covered(part: Part, lost: Mesh, left: Mesh) -> float:
    """The share of the opening over which what is left has skin: probes on the outer faces that lie on it."""
    outer = ~find_inner_faces(Solid(lost.vertices, lost.faces), part)
    corners = Mesh(lost.vertices, lost.faces[outer]).triangles
    weights = np.random.default_rng(1).dirichlet((3, 3, 3), 8)
    probes = np.einsum("kj,fjd->fkd", weights, corners).reshape(-1, 3)
    area = np.repeat(np.linalg.norm(lost.cross[outer], axis=1), len(weights))
    covered = distance_to_mesh(probes, left) < 1e-9 * part.diagonal
    return float((covered * area).sum() / area.sum())


def take(shape: trimesh.Trimesh, centre: Floats, radius: float) -> tuple[Part, Solid]:
    """A part and what a ball takes off it."""
    part = Part(np.array(shape.vertices), np.array(shape.faces))
    tool = ball(radius)
    found = to_solid(to_manifold(part) ^ to_manifold(Mesh(tool.vertices + centre, tool.faces)))
    assert found is not None
    return part, found


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(
    turn=st.floats(0, 6), tilt=st.floats(0.05, 3), radius=st.floats(0.8, 2.5), at=st.floats(-0.4, 0.4),
    far=st.booleans(),
)  # fmt: skip
def test_nothing_covers_the_opening(turn: float, tilt: float, radius: float, at: float, far: bool) -> None:
    """A turned prism of 60 long facets, which rounding takes off their planes."""
    shape = trimesh.creation.cylinder(radius=4, height=12, sections=60)
    frame = trimesh.transformations.euler_matrix(turn, tilt, 0.3)
    frame[:3, 3] = 1000 * far
    shape.apply_transform(frame)
    centre = frame[:3, :3] @ [4.0, 0.0, 12 * at] + frame[:3, 3]
    part, lost = take(shape, centre, radius)
    left = subtract_from_part(part, [lost])
    assert left is not None
    assert left.volume + lost.volume == pytest.approx(part.volume, rel=1e-9)
    assert find_covered(part, lost, left) < 0.002
    inner = lost.faces[find_inner_faces(lost, part)]
    assert distance_to_mesh(lost.vertices[inner].mean(axis=1), left).max() < 1e-9 * part.diagonal


def test_the_part_itself_without_losses_and_nothing_where_all_is_lost() -> None:
    cube = box()
    part = Part(np.array(cube.vertices), np.array(cube.faces))
    assert subtract_from_part(part, []) is part
    assert subtract_from_part(part, [Solid(part.vertices, part.faces)]) is None


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 1000), height=st.floats(1e-9, 1e-3))
def test_lifted_faces_stand_off_and_the_mesh_stays_closed(seed: int, height: float) -> None:
    shape = ball(1.0)
    lifted = np.random.default_rng(seed).random(len(shape.faces)) < 0.5
    made = lift_faces(shape, lifted, height)
    closed = Solid(made.vertices, made.faces)
    grown = closed.volume - shape.volume
    assert 0 < grown < 1.1 * height * shape.area
    kept = {tuple(face) for face in shape.faces[~lifted].tolist()}
    assert kept <= {tuple(face) for face in made.faces.tolist()}


@pytest.mark.slow
def test_nothing_covers_the_opening_of_a_prepared_cavity() -> None:
    """The faces of a cavity that is opened for deposition are many times smaller than those of the part."""
    shape = trimesh.creation.cylinder(radius=18, height=120, sections=96)
    part, damage = take(shape, np.array([14.0, 9.0, 40.0]), 4.0)
    prepare = {"min_radius": 1.5, "wall_angle": 20.0, "direction": (0.84, 0.54, 0.0)}
    deposit = Milling.model_validate({"prepare": prepare}).run(damage=damage, part=part, tolerance=0.1, others=None)
    assert isinstance(deposit, Deposit)
    assert deposit.cavity is not None
    left = subtract_from_part(part, [deposit.cavity], openings=[deposit.opening])
    assert left is not None
    assert left.volume + deposit.cavity.volume == pytest.approx(part.volume, rel=1e-7)
    assert find_covered(part, deposit.cavity, left) < 0.002
    # a cavity with rounding errors of its own
    middle = deposit.cavity.bounds.mean(axis=0)
    other = Solid(middle + (1 - SHRUNK) * (deposit.cavity.vertices - middle), deposit.cavity.faces)
    assert abs(other.volume - deposit.cavity.volume) > 1e-7 * part.volume
    left = subtract_from_part(part, [other], openings=[deposit.opening])
    assert left is not None
    assert find_covered(part, deposit.cavity, left) < 0.002


@pytest.mark.slow
def test_a_run_leaves_no_skin_over_the_opening() -> None:
    shape = trimesh.creation.cylinder(radius=10, height=40, sections=96)
    job = {
        "version": 1, "units": "mm", "tolerance": 0.2, "align": "none", "allowance": "none",
        "scan": {
            "use": "simulate", "points": 20000, "noise": 0.03, "seed": 2,
            "damage": [{"tool": "sphere", "centre": [9, 3, 1], "radius": 5}],
        },
    }  # fmt: skip
    result = damageest.run(job, part=shape)
    assert result.undamaged is not None
    assert len(result.sites) == 1
    assert find_covered(result.part, result.sites[0].damage, result.undamaged) < 0.002
