"""The checks for the stages that touch files: `part`, `scan` and `export`."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from damageest.artefacts import Evidence, Floats, Mesh, Part, Scan, Truth
from damageest.conformance import _scene
from damageest.conformance._base import REFUSED, PlacedContract, StageContract, back, right_or_refused
from damageest.geometry.distance import distance_to_mesh

BROKEN: dict[str, bytes | None] = {
    "missing": None,
    "empty": b"",
    "text": b"no such thing as a part or a scan\n" * 9,
    "noise": np.random.default_rng(8).bytes(5000),
    "zeros": bytes(5000),
    "page": b"<!DOCTYPE html><html><body>404</body></html>",
}


class _Reader(StageContract):
    """What readers of part and scan have in common."""

    def paths(self) -> list[Path]:
        """The files that the implementation was told to read; empty where it reads none."""
        given = getattr(self.stage, "path", ())
        return [given] if isinstance(given, Path) else list(given)

    def told(self, path: Path) -> Any:
        """The implementation, told to read another file."""
        return type(self.stage).model_validate({**self.stage.model_dump(), "path": path})

    def refuses(self, path: Path) -> None:
        with pytest.raises(REFUSED) as caught:
            self.call(self.told(path), self.inputs())
        assert path.name in str(caught.value), "the message names the file"

    def state(self, given: dict[str, Any]) -> dict[str, bytes]:
        return super().state(given) | {str(path): path.read_bytes() for path in self.paths()}

    @pytest.mark.parametrize("kind", BROKEN)
    def test_refuses_a_broken_file(self, kind: str, tmp_path: Path) -> None:
        for path in self.paths()[:1]:
            other = tmp_path / f"{kind}{path.suffix}"
            if (data := BROKEN[kind]) is not None:
                other.write_bytes(data)
            self.refuses(other)

    def test_refuses_a_folder(self, tmp_path: Path) -> None:
        for path in self.paths()[:1]:
            (tmp_path / f"folder{path.suffix}").mkdir()
            self.refuses(tmp_path / f"folder{path.suffix}")

    def test_a_file_cut_short(self, tmp_path: Path) -> None:
        for path in self.paths()[:1]:
            data = path.read_bytes()
            (tmp_path / f"cut{path.suffix}").write_bytes(data[: len(data) // 2])
            stage = self.told(tmp_path / f"cut{path.suffix}")
            right_or_refused(lambda stage=stage: self.call(stage, self.inputs()), self.sound)

    def sound(self, got: Any) -> None:
        """Whether a result could be used."""

    def test_gives_the_unit_asked_for(self) -> None:
        """A file that says its unit is converted; the numbers of one that does not are in the job's."""
        fine = self.run(unit="um", tolerance=1000 * _scene.TOLERANCE)
        assert (fine.unit, self.plain().unit) == ("um", "mm")
        ratio = _size(fine) / _size(self.plain())
        assert ratio == pytest.approx(1000, rel=1e-2) or ratio == pytest.approx(1, rel=1e-2)


class PartContract(_Reader):
    """Checks for `part`.

    ``volume``: of what the file holds, in cubic millimetres where the file says its unit; and ``error``, the share of
    it by which the part may be off.
    """

    volume: ClassVar[float]
    error: ClassVar[float] = 1e-6

    def test_has_the_volume_of_its_file(self) -> None:
        assert self.plain().volume == pytest.approx(self.volume, rel=self.error)

    def test_says_how_far_it_is_off_the_cad(self) -> None:
        assert 0 <= self.plain().tessellation_error <= _scene.TOLERANCE

    def test_without_a_tolerance_yet(self) -> None:
        assert self.run(tolerance=None).volume == pytest.approx(self.volume, rel=self.error)

    def sound(self, got: Any) -> None:
        assert isinstance(got, Part)


class ScanContract(_Reader, PlacedContract):
    """Checks for `scan`. ``mesh``: what the points of the file lie on; a virtual scanner's lie on the part."""

    mesh: ClassVar[Mesh | None] = None

    def scene(self) -> dict[str, Any]:
        return {**super().scene(), "part": _scene.prism()}

    def of(self, scale: float = 1.0, turn: Floats | None = None, shift: Floats | None = None) -> Any:
        if "part" not in self.stage.needs():
            pytest.skip("points in a file follow no part")
        return super().of(scale, turn, shift)

    def sound(self, got: Scan) -> None:
        assert len(got.points)
        assert np.isfinite(got.points).all()
        if got.normals is not None:
            assert np.linalg.norm(got.normals, axis=1) == pytest.approx(1, abs=1e-6)

    def test_finite_points_and_unit_normals(self) -> None:
        self.sound(self.plain())

    def test_lies_on_what_was_scanned(self) -> None:
        mesh, scan = self.mesh or _scene.prism(), self.plain()
        at = scan if scan.truth is None else scan.move(scan.truth.T_part_scan)
        far = distance_to_mesh(at.points, mesh)
        damage = scan.truth and scan.truth.damage
        if damage:
            hit = distance_to_mesh(at.points, damage)
            assert (hit[far > _scene.TOLERANCE] < _scene.TOLERANCE).mean() > 0.95, "points off part and damage"
        else:
            assert (far < _scene.TOLERANCE).mean() > 0.95

    def agree(self, got: Any, plain: Any, scale: float, turn: Floats, shift: Floats) -> None:
        """By the points' extent."""
        there = back(got.points, scale, turn, shift)
        got_extent, extent = (np.quantile(p, (0.01, 0.5, 0.99), axis=0) for p in (there, plain.points))
        assert np.allclose(got_extent, extent, atol=2 * _scene.TOLERANCE)


class ExportContract(StageContract):
    """Checks for `export`, on a result with two sites, one of them with a deposit of its own."""

    @pytest.fixture(autouse=True)
    def _folders(self, tmp_path: Path) -> None:
        self.home, self.count = tmp_path, 0

    def scene(self) -> dict[str, Any]:
        return {"result": result()}

    def call(self, stage: Any, given: dict[str, Any]) -> Any:
        self.count += 1
        self.folder = self.home / f"run {self.count}"
        self.folder.mkdir()
        return super().call(stage, {**given, "folder": self.folder, "writers": _writers()})

    def written(self, **changes: Any) -> dict[str, bytes]:
        """The files that a run says it has written, with their bytes."""
        files = self.run(**changes).files
        assert len(set(files)) == len(files), "a file twice"
        assert not [name for name in files if Path(name).is_absolute() or ".." in Path(name).parts]
        held = {str(p.relative_to(self.folder)) for p in self.folder.rglob("*") if p.is_file()}
        assert held == set(files), "it names the files that it has written, and no others"
        assert not [p for p in self.home.iterdir() if not p.name.startswith("run ")], "it writes outside the folder"
        return {name: (self.folder / name).read_bytes() for name in files}

    def test_writes_the_files_it_names(self) -> None:
        assert any(self.written().values())

    def test_same_files_twice(self) -> None:
        assert self.written() == self.written()

    def test_another_result_another_file(self) -> None:
        plain = result()
        assert self.written(result=replace(plain, sites=plain.sites[:1])) != self.written()

    def test_nothing_lost(self) -> None:
        plain = result()
        none = np.zeros_like(plain.site_label)
        self.written(result=replace(plain, sites=(), damage=None, site_label=none, undamaged=plain.part))

    def test_nothing_left(self) -> None:
        self.written(result=replace(result(), undamaged=None))

    def test_after_a_virtual_scan(self) -> None:
        plain = result()
        truth = Truth(plain.damage, np.eye(4))
        self.written(result=replace(plain, scan=replace(plain.scan, truth=truth), truth=np.array([1.0, 1.0])))


@lru_cache
def _writers() -> Any:
    from damageest.registry import Registry

    return Registry.discover().writers


def result() -> Any:
    """What a run finds on the scene."""
    from damageest.geometry.solids import to_manifold, to_solid, unite
    from damageest.result import Result, Site

    scene = _scene.scene()
    losses = [_scene.dent(k) for k in (0, 1)]
    lost = unite(losses)
    sites = [
        Site(k, (k,), scene.sites.members(k), loss, scene.surface, deposit, "surface", Evidence(), 1.8)
        for k, loss, deposit in zip((1, 2), losses, (None, losses[1]), strict=True)
    ]
    return Result(
        "scene", "mm", scene.tolerance, scene.part, scene.scan, scene.aligned, scene.pose, scene.deviation,
        scene.sites.label, tuple(sites), to_solid(lost), to_solid(to_manifold(scene.part) - lost), (), (), None,
    )  # fmt: skip


def _size(got: Any) -> float:
    return float(np.linalg.norm(np.ptp(got.points if isinstance(got, Scan) else got.vertices, axis=0)))
