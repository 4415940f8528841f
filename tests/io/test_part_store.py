"""What is kept of a part for later runs: the same results, and never a reason for a run to fail."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import damageest
from damageest.artefacts import Mesh
from damageest.io import part_store
from damageest.io.part_store import recall, use_part_store
from damageest.result import Result
from damageest.stages.align.surface.plane_grid import PartSurface
from damageest.stages.align.symmetry import prepare_part as _prepare_part


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DAMAGEEST_CACHE", str(tmp_path / "kept"))
    return tmp_path / "kept"


class Maker:
    """Counts how often it is asked."""

    def __init__(self, seed: int = 0) -> None:
        self.asked, self.seed = 0, seed

    def __call__(self) -> dict[str, np.ndarray]:
        self.asked += 1
        return {"a": np.random.default_rng(self.seed).normal(size=500), "b": np.arange(6, dtype=np.int32)}


def ask(make: Maker, key: str = "part", kind: str = "align") -> dict[str, np.ndarray]:
    with use_part_store(True):
        return dict(recall(kind, key, make))


def test_it_is_computed_once_for_each_kind_and_part(folder: Path) -> None:
    make = Maker()
    first, again = ask(make), ask(make)
    assert make.asked == 1
    for name, values in first.items():
        np.testing.assert_array_equal(values, again[name])
        assert values.dtype == again[name].dtype
    ask(make, key="another part")
    ask(make, kind="symmetries")
    assert make.asked == 3
    assert not [path for path in folder.iterdir() if path.suffix != ".npz"]


def test_nothing_is_kept_where_it_is_not_asked_for(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make = Maker()
    recall("align", "part", make)
    with use_part_store(False):
        recall("align", "part", make)
    monkeypatch.setenv("DAMAGEEST_CACHE", "none")
    ask(make)
    assert make.asked == 3
    assert not folder.exists()


@pytest.mark.parametrize("where", [0, 40, 2000, -100])
def test_a_damaged_entry_is_computed_again(folder: Path, where: int) -> None:
    first = ask(Maker())
    (path,) = folder.glob("*.npz")
    data = bytearray(path.read_bytes())
    data[where] ^= 0xFF
    path.write_bytes(data)
    again = ask(Maker())
    np.testing.assert_array_equal(first["a"], again["a"])


def test_an_entry_under_another_name_is_not_used(folder: Path) -> None:
    ask(Maker(1), key="one")
    (one,) = folder.glob("*.npz")
    ask(Maker(2), key="two")
    (two,) = set(folder.glob("*.npz")) - {one}
    two.write_bytes(one.read_bytes())
    assert not np.array_equal(ask(Maker(2), key="two")["a"], Maker(1)()["a"])


def test_a_place_that_cannot_be_written_is_no_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("DAMAGEEST_CACHE", str(tmp_path / "file" / "kept"))
    make = Maker()
    ask(make)
    ask(make)
    assert make.asked == 2


def test_the_folder_does_not_grow_without_limit(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(part_store, "MOST_BYTES", 12_000)
    for number in range(8):
        ask(Maker(), key=f"part {number}")
    assert sum(path.stat().st_size for path in folder.iterdir()) <= 12_000
    make = Maker()
    ask(make, key="part 7")
    assert make.asked == 0  # the last one is still there


def run(cache: bool = True) -> Result:
    _prepare_part._prepare_once.cache_clear()  # as in another process
    box = trimesh.creation.box((40, 30, 20))
    points, _ = trimesh.sample.sample_surface(box, 8000, seed=1)
    points = points[np.linalg.norm(points - [20, 15, 10], axis=1) > 6]
    return damageest.run({"version": 1, "tolerance": 0.2}, part=box, scan=points, cache=cache)


@pytest.mark.slow
def test_a_run_gives_the_same_with_and_without_what_is_kept(folder: Path) -> None:
    without = run(cache=False)
    assert not folder.exists()
    cold = run()
    assert list(folder.glob("align-*.npz"))
    warm = run()
    for other in (cold, warm):
        assert without.pose.T_part_scan.tobytes() == other.pose.T_part_scan.tobytes()
        assert [len(site.damage.faces) for site in without.sites] == [len(site.damage.faces) for site in other.sites]


@pytest.mark.slow
def test_what_is_kept_of_a_part_is_what_was_computed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All that an alignment takes from it: the grid of planes and the table of pairs."""
    monkeypatch.setattr(_prepare_part, "SURFACE_POINTS", 2000)
    box = trimesh.creation.box((0.7, 0.5, 0.4))
    mesh = Mesh(np.asarray(box.vertices), np.asarray(box.faces))
    asked = _prepare_part._Asked("digest", 0, PartSurface(mesh))
    prepared = []
    for kept in (False, True, True):
        with use_part_store(kept):
            prepared.append(_prepare_part._prepare(asked))
    assert len(list(folder.glob("align-*.npz"))) == 1
    without, cold, warm = (
        [a.tobytes() for a in (p.grid.plane, p.grid.distance, p.pairs.points.points, p.pairs.i, p.pairs.j, p.pairs.key)]
        for p in prepared
    )
    assert without == cold == warm
