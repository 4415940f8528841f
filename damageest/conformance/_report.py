"""The checks for the stage `report`."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np

from damageest.conformance._files import make_result
from damageest.conformance._written import WritingContract

DATES = re.compile(rb"<!-- dates and times: begin -->.*?<!-- dates and times: end -->", re.DOTALL)

PNG = b"\x89PNG\r\n\x1a\n"


class ReportContract(WritingContract):
    """Checks for `report`, on a result with two sites, one of them with a deposit.

    Dates and times of a page in HTML are to stand between the comments ``dates and times: begin`` and ``dates and
    times: end``; override `without_dates` for another format.
    """

    def make_scene(self) -> dict[str, Any]:
        result = make_result()
        return {"result": result, "content": describe(result), "job_text": "version: 1\n"}

    def without_dates(self, data: bytes) -> bytes:
        """The bytes of a file without its dates and times."""
        return DATES.sub(b"", data)

    def check_files(self, result: Any, written: dict[str, bytes], stray: list[str]) -> dict[str, bytes]:
        assert not result.picture or result.picture.startswith(PNG), "the picture is no PNG"
        return super().check_files(result, written, stray)

    def write_report(self, result: Any) -> None:
        """Runs the report of a result, and checks its files."""
        self.write_files(result=result, content=describe(result))

    def test_nothing_lost(self) -> None:
        result = make_result()
        none = np.zeros_like(result.site_label)
        self.write_report(replace(result, sites=(), damage=None, site_label=none, undamaged=result.part))

    def test_nothing_left(self) -> None:
        self.write_report(replace(make_result(), undamaged=None))

    def test_incomplete(self) -> None:
        result = make_result()
        self.write_report(replace(result, sites=result.sites[:1], failures=("boolean: manifold (site 2): it failed",)))


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
