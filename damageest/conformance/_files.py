"""The checks for the stages that read or write files: `part`, `scan` and `export`."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from damageest.artefacts import Evidence, Floats, Mesh, Part, Scan, Truth
from damageest.conformance import _scene
from damageest.conformance._base import (
    REFUSED,
    PlacementContract,
    StageContract,
    check_or_refused,
    name_changes,
    undo_placement,
)
from damageest.conformance._written import WritingContract
from damageest.geometry.distance import distance_to_mesh

BROKEN: dict[str, bytes | None] = {
    "missing": None,
    "empty": b"",
    "text": b"no such thing as a part or a scan\n" * 9,
    "noise": np.random.default_rng(8).bytes(5000),
    "zeros": bytes(5000),
    "page": b"<!DOCTYPE html><html><body>404</body></html>",
}


class ReaderContract(StageContract):
    """The checks for readers of a part or a scan."""

    def get_paths(self) -> list[Path]:
        """The files in the implementation's option ``path``; empty if it reads no file."""
        given = getattr(self.stage, "path", ())
        return [given] if isinstance(given, Path) else list(given)

    def with_path(self, path: Path) -> Any:
        """The implementation, with another file in ``path``."""
        return type(self.stage).model_validate({**self.stage.model_dump(), "path": path})

    def check_refuses(self, path: Path) -> None:
        """Asserts that reading ``path`` raises an error that names the file."""
        with pytest.raises(REFUSED) as caught:
            self.call(self.with_path(path), self.make_inputs())
        assert path.name in str(caught.value), "the message must name the file"

    def capture_state(self, given: dict[str, Any]) -> dict[str, bytes]:
        return super().capture_state(given) | {str(path): path.read_bytes() for path in self.get_paths()}

    @pytest.mark.parametrize("kind", BROKEN)
    def test_refuses_a_broken_file(self, kind: str, tmp_path: Path) -> None:
        for path in self.get_paths()[:1]:
            other = tmp_path / f"{kind}{path.suffix}"
            if (data := BROKEN[kind]) is not None:
                other.write_bytes(data)
            self.check_refuses(other)

    def test_refuses_a_folder(self, tmp_path: Path) -> None:
        for path in self.get_paths()[:1]:
            (tmp_path / f"folder{path.suffix}").mkdir()
            self.check_refuses(tmp_path / f"folder{path.suffix}")

    def test_a_file_cut_short(self, tmp_path: Path) -> None:
        for path in self.get_paths()[:1]:
            data = path.read_bytes()
            (tmp_path / f"cut{path.suffix}").write_bytes(data[: len(data) // 2])
            stage = self.with_path(tmp_path / f"cut{path.suffix}")
            check_or_refused(lambda stage=stage: self.call(stage, self.make_inputs()), self.check_usable)

    def check_usable(self, got: Any) -> None:
        """Asserts that a result is complete enough to be used."""

    def test_gives_the_unit_asked_for(self) -> None:
        """The lengths of a file with a unit are converted. Those of a file without one are in the job's unit."""
        fine = self.run(unit="um", tolerance=1000 * _scene.TOLERANCE)
        assert (fine.unit, self.get_result().unit) == ("um", "mm")
        ratio = _measure_extent(fine) / _measure_extent(self.get_result())
        assert ratio == pytest.approx(1000, rel=1e-2) or ratio == pytest.approx(1, rel=1e-2)


class PartContract(ReaderContract):
    """Checks for `part`.

    ``volume``: the volume of the part in the file; in cubic millimetres if the file has a unit. ``error``: allowed
    error of the volume, as a share of it.
    """

    volume: ClassVar[float]
    error: ClassVar[float] = 1e-6

    def test_has_the_volume_of_its_file(self) -> None:
        assert self.get_result().volume == pytest.approx(self.volume, rel=self.error)

    def test_says_how_far_it_is_off_the_cad(self) -> None:
        assert 0 <= self.get_result().tessellation_error <= _scene.TOLERANCE

    def test_without_a_tolerance_yet(self) -> None:
        assert self.run(tolerance=None).volume == pytest.approx(self.volume, rel=self.error)

    def check_usable(self, got: Any) -> None:
        assert isinstance(got, Part)


class ScanContract(ReaderContract, PlacementContract):
    """Checks for `scan`. ``mesh``: the surface that the file's points lie on; None: the part, for a virtual scanner."""

    mesh: ClassVar[Mesh | None] = None

    def make_scene(self) -> dict[str, Any]:
        return {**super().make_scene(), "part": _scene.make_prism()}

    def run_placed(self, scale: float = 1.0, turn: Floats | None = None, shift: Floats | None = None) -> Any:
        if "part" not in self.stage.needs():
            pytest.skip("the points of a file do not move with the part")
        return super().run_placed(scale, turn, shift)

    def check_usable(self, got: Scan) -> None:
        assert len(got.points)
        assert np.isfinite(got.points).all()
        if got.normals is not None:
            assert np.linalg.norm(got.normals, axis=1) == pytest.approx(1, abs=1e-6)

    def test_finite_points_and_unit_normals(self) -> None:
        self.check_usable(self.get_result())

    def test_lies_on_what_was_scanned(self) -> None:
        mesh, scan = self.mesh or _scene.make_prism(), self.get_result()
        at = scan if scan.truth is None else scan.move(scan.truth.T_part_scan)
        far = distance_to_mesh(at.points, mesh)
        damage = scan.truth and scan.truth.damage
        if damage:
            hit = distance_to_mesh(at.points, damage)
            assert (hit[far > _scene.TOLERANCE] < _scene.TOLERANCE).mean() > 0.95, "points off part and damage"
        else:
            assert (far < _scene.TOLERANCE).mean() > 0.95

    def check_agrees(self, got: Any, expected: Any, scale: float, turn: Floats, shift: Floats) -> None:
        """Compares the extents of the points."""
        found = undo_placement(got.points, scale, turn, shift)
        got_extent, extent = (np.quantile(p, (0.01, 0.5, 0.99), axis=0) for p in (found, expected.points))
        assert np.allclose(got_extent, extent, atol=2 * _scene.TOLERANCE)


class ExportContract(WritingContract):
    """Checks for `export`, on a result with two sites, one of them with a deposit."""

    def make_scene(self) -> dict[str, Any]:
        return {"result": make_result()}

    def call(self, stage: Any, given: dict[str, Any]) -> Any:
        return super().call(stage, {**given, **_load_writers()})

    def test_writes_the_files_it_names(self) -> None:
        assert any(self.get_files().values())

    def test_another_result_another_file(self) -> None:
        result = make_result()
        fewer = self.write_files(result=replace(result, sites=result.sites[:1]))
        assert name_changes(self.get_files(), fewer), "the files of two different results are identical"

    def test_nothing_lost(self) -> None:
        result = make_result()
        none = np.zeros_like(result.site_label)
        self.write_files(result=replace(result, sites=(), damage=None, site_label=none, undamaged=result.part))

    def test_nothing_left(self) -> None:
        self.write_files(result=replace(make_result(), undamaged=None))

    def test_after_a_virtual_scan(self) -> None:
        result = make_result()
        truth = Truth(result.damage, np.eye(4))
        self.write_files(result=replace(result, scan=replace(result.scan, truth=truth), truth=np.array([1.0, 1.0])))


@lru_cache
def _load_writers() -> Any:
    from damageest.registry import Registry

    registry = Registry.discover()
    return {"writers": registry.writers, "path_writers": registry.path_writers}


def make_result() -> Any:
    """The result of a run on the scene."""
    from damageest.geometry.solids import to_manifold, to_solid, unite
    from damageest.result import Result, Site

    scene = _scene.make_scene()
    losses = [_scene.make_dent(k) for k in (0, 1)]
    lost = unite(losses)
    sites = [
        Site(k, (k,), scene.sites.members(k), loss, scene.surface, deposit, "surface", Evidence(), 1.8)
        for k, loss, deposit in zip((1, 2), losses, (None, losses[1]), strict=True)
    ]
    return Result(
        "scene", "mm", scene.tolerance, scene.part, scene.scan, scene.aligned, scene.pose, scene.deviation,
        scene.sites.label, tuple(sites), to_solid(lost), to_solid(to_manifold(scene.part) - lost), (), (), None,
    )  # fmt: skip


def _measure_extent(got: Any) -> float:
    return float(np.linalg.norm(np.ptp(got.points if isinstance(got, Scan) else got.vertices, axis=0)))
