"""What other parts of the type predict: an end that is lost, how well it is known, and whether it is their type."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest

import damageest
from damageest.artefacts import AdaptedPart, Floats, Scan, fit_displacement
from damageest.errors import InputError, JobError, StageError
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.transforms import move_points
from damageest.io.forms import MeasuredForm, identify_part, read_form, write_form
from damageest.stages.adapt.smooth import Smooth
from tests import damaged_box

TOLERANCE = 0.2
NOISE = 0.05
PART = damaged_box.box()
HALF = float(np.ptp(PART.bounds, axis=0).max()) / 2
CENTRE = PART.bounds.mean(axis=0)
LOST = 0.75
"""Place along the longest axis, in half lengths, from which the end is lost."""
SKIN, FACE = sample_by_area(PART, 9000, np.random.default_rng(0))


def displace(places: Floats, bend: float, turn: float, kink: float = 1.0) -> Floats:
    """A part of the type: bent and twisted by an amount of its own, and all with the same kink near the end, of which
    skin that is left shows the beginning alone."""
    q = (places - CENTRE) / HALF
    x, y, z = q.T
    up = bend * x**2 + kink * np.maximum(x - 0.4, 0) ** 2
    moved = np.stack([-2 * bend * x * z, turn * x * z, up - turn * x * y], axis=1)
    return np.asarray(moved)


def draw(number: int) -> tuple[float, float]:
    bend, turn = np.random.default_rng(number).normal(0, 0.2, 2)
    return 1.0 + float(bend), 0.5 + float(turn)


@lru_cache
def write_others(count: int, lost: bool = False) -> tuple[Path, ...]:
    """Files of so many other parts, which were seen all over, or have lost the same end."""
    folder = Path(mkdtemp(prefix="damageest-forms-"))
    seen = SKIN[::4]
    seen = seen[(seen - CENTRE)[:, 0] < LOST * HALF] if lost else seen
    files = []
    for number in range(count):
        field = fit_displacement(lambda at, k=number: displace(at, *draw(k)), *PART.bounds, (4, 3, 2))
        form = MeasuredForm(
            field, seen, np.zeros(len(seen)), 2.0, PART.unit, TOLERANCE, identify_part(PART), marks=(float(number + 1),)
        )
        files.append(folder / f"{number}.npz")
        write_form(files[-1], form)
    return tuple(files)


def scan(bend: float, turn: float, kink: float = 1.0, cut: bool = True) -> Scan:
    """A scan of a part, whose end is lost."""
    kept = (SKIN - CENTRE)[:, 0] < LOST * HALF if cut else np.ones(len(SKIN), bool)
    points = SKIN[kept] + displace(SKIN[kept], bend, turn, kink)
    points = points + np.random.default_rng(5).normal(0, NOISE, points.shape)
    return Scan(points, noise=NOISE, spacing=0.7)


@lru_cache
def adapt(files: tuple[Path, ...], kink: float = 1.0, bend: float = 1.1) -> AdaptedPart:
    found = Smooth(points=2000, lattice=(), prior=files).run(PART, scan(bend, 0.4, kink), TOLERANCE)
    assert found is not None
    return found


def measure(adapted: AdaptedPart, kink: float = 1.0, bend: float = 1.1) -> tuple[float, float, float]:
    """Of the lost end: mean error of its skin, mean half width of the 95 % interval, share inside."""
    before = adapted.part.vertices - adapted.displacement
    true = move_points(before + displace(before, bend, 0.4, kink), adapted.motion)
    end = (before - CENTRE)[:, 0] > LOST * HALF
    off = np.abs(np.einsum("ij,ij->i", adapted.part.vertices - true, adapted.part.vertex_normals))[end]
    moved = np.einsum("kvc,vc->kv", adapted.modes, adapted.part.vertex_normals)[:, end]
    half = 1.96 * np.sqrt((moved**2).sum(axis=0))
    return float(off.mean()), float(half.mean()), float((off <= half).mean())


@pytest.mark.slow
def test_a_lost_end_is_predicted_from_other_parts() -> None:
    alone, _, _ = measure(adapt(()))
    error, half, inside = measure(adapt(write_others(8)))
    assert error < 0.4 * alone
    assert error < 0.15 * TOLERANCE
    assert half < TOLERANCE
    assert inside > 0.9
    prior = adapt(write_others(8)).prior
    assert prior is not None
    assert (prior.parts, prior.is_used) == (8, True)


@pytest.mark.slow
def test_few_parts_give_a_wider_interval() -> None:
    many, few, one = (measure(adapt(write_others(count))) for count in (8, 4, 1))
    assert many[1] < few[1]
    assert few[2] > 0.9
    assert one[1] > 0.8 * measure(adapt(()))[1]
    assert any("too few to narrow" in note for note in adapt(write_others(1)).notes)


@pytest.mark.slow
def test_a_part_of_another_kind_is_noticed() -> None:
    """It is bent far more than any of the others: what they say of its end is not taken."""
    adapted, alone = adapt(write_others(8), bend=5.0), adapt((), bend=5.0)
    assert adapted.prior is not None
    assert not adapted.prior.is_used
    assert any("deforms in another way" in note for note in adapted.notes)
    assert np.array_equal(adapted.displacement, alone.displacement)
    assert np.array_equal(adapted.modes, alone.modes)


@pytest.mark.slow
def test_an_end_that_all_have_lost_is_no_better_known() -> None:
    adapted = adapt(write_others(8, lost=True))
    assert measure(adapted)[1] > 0.8 * measure(adapt(()))[1]
    assert any("fewer than 3 of them show" in note for note in adapted.notes)


@pytest.mark.slow
def test_where_skin_is_seen_the_scan_decides() -> None:
    """The others have no kink at all, and this part has: its seen skin is followed."""
    files = write_others(8)
    given = scan(1.1, 0.4, 0.0, cut=False)
    found = Smooth(points=2000, lattice=(), prior=files).run(PART, given, TOLERANCE)
    assert found is not None
    before = found.part.vertices - found.displacement
    true = move_points(before + displace(before, 1.1, 0.4, 0.0), found.motion)
    assert np.abs(np.einsum("ij,ij->i", found.part.vertices - true, found.part.vertex_normals)).mean() < 0.2 * TOLERANCE


@pytest.mark.slow
def test_the_field_says_where_each_place_went() -> None:
    adapted = adapt(write_others(8))
    assert adapted.field is not None
    before = adapted.part.vertices - adapted.displacement
    assert np.abs(adapted.field.displace(before) - adapted.displacement).max() < 0.1 * TOLERANCE


def test_a_part_is_no_evidence_for_itself(tmp_path: Path) -> None:
    given = scan(1.1, 0.4)
    field = fit_displacement(lambda at: displace(at, 1.1, 0.4), *PART.bounds, (4, 3, 2))
    from damageest.io.forms import mark_scan

    form = MeasuredForm(
        field, SKIN[::9], np.zeros(1000), 2.0, "mm", TOLERANCE, identify_part(PART), marks=mark_scan(given)
    )
    write_form(tmp_path / "own.npz", form)
    with pytest.raises(StageError, match="other parts are needed"):
        Smooth(points=2000, lattice=(), prior=(tmp_path / "own.npz",)).run(PART, given, TOLERANCE)


def change(path: Path, name: str, value: object) -> None:
    with np.load(path) as stored:
        arrays = dict(stored)
    np.savez(path, **{**arrays, name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("unit", "its lengths are in in, those of this job in mm"),
        ("part", "is the form of another part"),
        ("version", "has version 99"),
        ("nan", "is no form of a measured part, or damaged"),
        ("pickle", "is no form of a measured part, or damaged"),
        ("cut", "is no form of a measured part, or damaged"),
        ("bomb", "MB of arrays"),
        ("missing", "there is no such file"),
        ("text", "is no form of a measured part, or damaged"),
    ],
)
def test_a_file_that_is_no_prior_is_refused(kind: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "form.npz"
    path.write_bytes(write_others(1)[0].read_bytes())
    if kind == "unit":
        change(path, "unit", "in")
    elif kind == "part":
        change(path, "part", np.array(["another"]))
    elif kind == "version":
        change(path, "version", 99)
    elif kind == "nan":
        change(path, "controls", np.full((4, 4, 4, 3), np.nan))
    elif kind == "pickle":
        change(path, "seen", np.array([{}], dtype=object))
    elif kind == "cut":
        path.write_bytes(path.read_bytes()[:-400])
    elif kind == "bomb":
        np.savez_compressed(path, seen=np.zeros((4_000_000, 3)))
    elif kind == "text":
        path.write_text("no archive")
    else:
        path.unlink()
    with pytest.raises(InputError, match=said) as caught:
        Smooth(points=2000, lattice=(), prior=(path,)).run(PART, scan(1.1, 0.4), TOLERANCE)
    assert str(path) in str(caught.value)


JOB = {"version": 1, "units": "mm", "tolerance": TOLERANCE, "align": "icp", "report": "none", "export": "files"}


@pytest.mark.slow
def test_a_job_writes_its_form_and_takes_those_of_others(tmp_path: Path) -> None:
    flat = CENTRE + np.random.default_rng(8).uniform(-0.5, 0.5, (1500, 3)) * np.ptp(PART.bounds, axis=0)
    flat[:, 0] = CENTRE[0] + LOST * HALF  # where it broke
    noise = np.random.default_rng(9).normal(0, NOISE, flat.shape)
    given = Scan(np.concatenate([scan(1.1, 0.4).points, flat + displace(flat, 1.1, 0.4) + noise]))
    first = damageest.run(
        JOB,
        part=PART,
        scan=given,
        settings=["adapt=smooth", "adapt.points=2000", "adapt.lattice=[]"],
        output=tmp_path / "a",
    )
    form = read_form(tmp_path / "a/adapt.npz")
    assert first.adapted is not None
    assert first.adapted.field is not None
    assert np.array_equal(form.field.controls, first.adapted.field.controls)
    assert (form.seen[:, 0] < CENTRE[0] + (LOST + 0.05) * HALF).all(), "skin that is lost was not seen"
    for path in write_others(5):
        (tmp_path / f"o{path.stem}").mkdir()
        (tmp_path / f"o{path.stem}/adapt.npz").write_bytes(path.read_bytes())
    asked = ["adapt=smooth", "adapt.points=2000", "adapt.lattice=[]", f"adapt.prior={tmp_path}/*/adapt.npz"]
    second = damageest.run(JOB, part=PART, scan=given, settings=asked, output=tmp_path / "a")
    assert second.adapted is not None
    assert second.adapted.prior is not None
    assert second.adapted.prior.parts == 5, "its own earlier form is left out"
    before, after = (
        max(site.uncertainty.adapt for site in found.sites if site.uncertainty) for found in (first, second)
    )
    assert after < before


def test_a_glob_without_files_is_a_fault_of_the_job(tmp_path: Path) -> None:
    with pytest.raises(JobError, match=r"adapt\.prior.*no file matches"):
        damageest.run(JOB, part=PART, scan=scan(1.1, 0.4), settings=["adapt=smooth", f"adapt.prior={tmp_path}/*.npz"])


def test_a_job_whose_only_prior_is_its_own_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a/adapt.npz").write_bytes(write_others(1)[0].read_bytes())
    asked = ["adapt=smooth", f"adapt.prior={tmp_path}/*/adapt.npz"]
    with pytest.raises(InputError, match="names only"):
        damageest.run(JOB, part=PART, scan=scan(1.1, 0.4), settings=asked, output=tmp_path / "a")
