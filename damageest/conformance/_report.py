"""The checks for the stage `report`."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from damageest.conformance._base import StageContract, name_changes
from damageest.conformance._files import make_result

DATES = re.compile(rb"<!-- dates and times: begin -->.*?<!-- dates and times: end -->", re.DOTALL)

PNG = b"\x89PNG\r\n\x1a\n"


class ReportContract(StageContract):
    """Checks for `report`, on a result with two sites, one of them with a deposit.

    Dates and times of a page in HTML are to stand between the comments ``dates and times: begin`` and ``dates and
    times: end``; override `without_dates` for another format.
    """

    @pytest.fixture(autouse=True)
    def _set_folders(self, tmp_path: Path) -> None:
        self.home, self.count = tmp_path, 0

    def make_scene(self) -> dict[str, Any]:
        result = make_result()
        return {"result": result, "content": describe(result), "job_text": "version: 1\n"}

    def call(self, stage: Any, given: dict[str, Any]) -> Any:
        self.count += 1
        self.folder = self.home / f"run {self.count}"
        self.folder.mkdir()
        return super().call(stage, {**given, "folder": self.folder})

    def without_dates(self, data: bytes) -> bytes:
        """The bytes of a file without its dates and times."""
        return DATES.sub(b"", data)

    def write_files(self, result: Any = None) -> dict[str, bytes]:
        """Runs the report and gives the bytes of the files that it names, by path, without dates."""
        changes = {} if result is None else {"result": result, "content": describe(result)}
        done = self.run(**changes)
        files = done.files
        assert not done.picture or done.picture.startswith(PNG), "the picture is no PNG"
        assert len(set(files)) == len(files), "a file is named twice"
        held = {p.relative_to(self.folder).as_posix() for p in self.folder.rglob("*") if p.is_file()}
        assert held == set(files), "the named files differ from the files in the folder"
        return {name: self.without_dates((self.folder / name).read_bytes()) for name in files}

    def test_writes_the_files_it_names(self) -> None:
        self.write_files()

    def test_same_files_twice(self) -> None:
        changed = name_changes(self.write_files(), self.write_files())
        assert not changed, "the second run wrote other bytes into these files"

    def test_nothing_lost(self) -> None:
        result = make_result()
        none = np.zeros_like(result.site_label)
        self.write_files(replace(result, sites=(), damage=None, site_label=none, undamaged=result.part))

    def test_nothing_left(self) -> None:
        self.write_files(replace(make_result(), undamaged=None))

    def test_incomplete(self) -> None:
        result = make_result()
        self.write_files(replace(result, sites=result.sites[:1], failures=("boolean: manifold (site 2): it failed",)))


def describe(result: Any) -> dict[str, Any]:
    """The content of result.json of a result that a report may use."""
    sites = [
        {
            "id": site.id,
            "points": len(site.points),
            "volume": site.damage.volume,
            "surface_area": site.surface.area,
            "max_depth": site.max_depth,
            "verdict": {"level": site.verdict.level, "reasons": [vars(reason) for reason in site.verdict.reasons]},
            "accepted": site.accepted,
            "deposit": None,
            "files": {
                "damage": f"damage/site-{site.id}.stl",
                "surface": None,
                "deposit": None,
                "milled": None,
                "every": [],
            },
            "warnings": [vars(reason) for reason in site.warnings],
        }
        for site in result.sites
    ]
    scan, pose = result.scan, result.pose
    return {
        "schema": 1,
        "status": result.status,
        "name": result.name,
        "units": result.units,
        "tolerance": result.tolerance,
        "part": {"path": "", "sha256": "", "volume": result.part.volume, "notes": []},
        "scan": {"paths": [], "points": len(scan.points), "noise": scan.noise, "spacing": scan.spacing, "notes": []},
        "alignment": {
            "transform": pose.T_part_scan.tolist(), "rms": pose.rms, "inliers": pose.inliers, "alternatives": [],
            "notes": [], "doubts": [],
        },
        "deviation": {"labels": dict.fromkeys(("intact", "damage", "added", "outlier"), 0), "intact_percentiles": {}},
        "coverage": None,
        "sites": sites,
        "surplus": [],
        "export": {"files": [], "notes": []},
        "damage_volume": result.damage_volume,
        "truth": None,
        "stages": [],
        "failures": list(result.failures),
        "warnings": [vars(reason) for reason in result.warnings],
        "versions": {"damageest": "0"},
    }  # fmt: skip
