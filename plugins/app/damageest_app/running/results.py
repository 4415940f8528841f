"""What a run has written, as the rows and words that the page shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh
from damageest.io.colours import colour_site
from damageest.output.folder import OutputFolder, open_output

LEVELS = ("proven", "likely", "doubtful")
MUCH = 0.05
"""Share of a deposit that a path leaves out, or adds, from which that is said in red."""
Json = Mapping[str, Any]


class Results:
    """An output folder. Solids and the scan are read when they are asked for, and kept."""

    def __init__(self, folder: Path) -> None:
        """Raises InputError where the folder has no result."""
        self.output: OutputFolder = open_output(folder)
        self.content: Json = self.output.content
        self._solids: dict[tuple[str, int], Any] = {}

    @property
    def tolerance(self) -> float:
        return float(self.content["tolerance"])

    @property
    def unit(self) -> str:
        return self.output.unit

    def read_solid(self, kind: str, site: int = 0) -> Any:
        key = (kind, site)
        if key not in self._solids:
            self._solids[key] = self.output.read_solid(kind, site)
        return self._solids[key]

    @cached_property
    def skin(self) -> tuple[Mesh, Floats] | None:
        """The skin in cells, and the mean signed distance (F,) of the scan to each, NaN where there is none."""
        path = self.output.place / "skin.ply"
        if not path.is_file():
            return None
        import trimesh

        mesh = self.output.read_mesh("skin.ply")
        columns = trimesh.load(path, process=False).metadata["_ply_raw"]["face"]["data"]
        return None if mesh is None else (mesh, np.asarray(columns["distance"], float).ravel())

    def list_sites(self, values: Json) -> list[dict[str, Any]]:
        """A row for each site; ``values``: the job, which says what a person has decided since."""
        accept, sites = values.get("accept", []), values.get("sites") or {}
        accept = accept if isinstance(accept, list) else []
        rows = []
        for site in self.content["sites"]:
            level, number = site["verdict"]["level"], site["id"]
            dropped = number in (sites.get("drop") or [])
            merged = [group for group in sites.get("merge") or [] if number in group]
            choice = "drop" if dropped else "accept" if number in accept else ""
            rows.append(
                {
                    "id": number,
                    "level": level,
                    "icon": {"proven": "mdi-check-decagram", "likely": "mdi-check-circle-outline"}.get(
                        level, "mdi-help-circle-outline"
                    ),
                    "tone": {"proven": "success", "likely": "info"}.get(level, "warning"),
                    "colour": colour_site(number),
                    "volume": f"{site['volume']:.5g}",
                    "interval": format_interval(site["volume_95"]),
                    "depth": f"{site['max_depth']:.3g}",
                    "area": f"{site['surface_area']:.4g}",
                    "choice": choice,
                    "merged": ", ".join(map(str, merged[0])) if merged else "",
                    "reasons": [
                        {"text": reason["text"], "remedy": reason.get("remedy") or ""}
                        for reason in site["verdict"]["reasons"]
                    ],
                }
            )
        return rows

    def summarise(self) -> list[str]:
        """What the whole run says, in lines."""
        content, unit = self.content, self.unit
        lines = [f"damage {content['damage_volume']:.5g} {unit}³ (95 %: {format_interval(content['volume_95'])})"]
        if told := self._describe_volumes():
            lines.append(told)
        if content.get("coverage"):
            lines.append(
                f"tolerance {self.tolerance:.4g} {unit}; {content['coverage']['seen']:.0%} of the skin is seen"
            )
        if content.get("fit"):
            lines.append(f"fit: {content['fit']['words']}")
        return lines

    def _describe_volumes(self) -> str:
        """Lost metal, cut-back and stock, where there is more than the first."""
        material, files = self.content["material"], self.content["export"]["files"]
        milled = {int(Path(name).stem.removeprefix("site-")) for name in files if name.startswith("milled/site-")}
        within = sum(
            site["deposit"]["cut_back_volume"]
            for site in self.content["sites"]
            if site.get("deposit") and site["id"] not in milled  # metal that `prepare` mills off is in no damage volume
        )
        more = [("cut-back", material["cut_back_volume"]), ("stock", material["stock_volume"])]
        told = [f"{name} {volume:.4g} {self.unit}³" for name, volume in more if volume > 0]
        lost = f"lost metal {self.content['damage_volume'] - within:.4g} {self.unit}³"
        return ", ".join([lost, *told]) if told else ""

    def list_notes(self) -> list[dict[str, str]]:
        """What the run noted, and what failed."""
        failed = [{"text": str(one), "remedy": ""} for one in self.content["failures"]]
        doubts = [
            {"text": str(one["text"]), "remedy": str(one.get("remedy") or "")} for one in self.content["warnings"]
        ]
        return failed + doubts

    def list_poses(self) -> list[Any]:
        """The pose (4,4) of the run, then the others that fit as well."""
        alignment = self.content["alignment"]
        return [np.array(alignment["transform"]), *(np.array(one) for one in alignment["alternatives"])]

    def list_paths(self) -> list[tuple[int, Path]]:
        """The deposition paths as tables, by site."""
        found = []
        for site in self.content["sites"]:
            names = (site.get("path") or {}).get("files", [])
            found += [(site["id"], self.output.folder / name) for name in names if name.endswith(".csv")]
        return found

    def list_path_faults(self) -> list[dict[str, Any]]:
        """What the paths leave out or add, site by site: ``text``; ``is_much``: whether more than `MUCH` of a deposit
        is not filled, so that no one takes the path to a machine unaware of it."""
        found = []
        for site in self.content["sites"]:
            path = site.get("path") or {}
            whole = float(path.get("deposit_volume") or 0.0)
            if not whole:
                continue
            filled = (path.get("fill") or {}).get("of_deposit")
            left = float(path["unreachable_volume"]) / whole if filled is None else 1 - float(filled)
            parts = [f"{one['volume']:.3g} {self.unit}³ {one['why']}" for one in path["unreached"]]
            extra = float(path.get("surplus_volume") or 0.0) / whole
            if extra > MUCH:
                parts.append(f"the passes add {extra:.0%} beyond the reached volume")
            if left > MUCH or parts:
                text = f"site {site['id']}: {left:.1%} of the deposit is not filled"
                found.append({"text": "; ".join([text, *parts]), "is_much": left > MUCH})
            notes = [str(one["text"]) for one in site.get("warnings", ()) if one["code"] == "path"]
            found += [{"text": f"site {site['id']}: {note}", "is_much": False} for note in notes]
        return found

    def list_files(self) -> list[str]:
        """The files of the result for other programs."""
        own = [item["path"] for item in self.content.get("provenance", {}).get("outputs", [])]
        return own or list(self.content["export"]["files"])

    def tell_files(self) -> list[str]:
        """The same as they are shown: those that may not be opened are marked."""
        return [f"{name} (other programs may refuse it)" if "-invalid." in name else name for name in self.list_files()]

    def describe_deposits(self) -> list[str]:
        unit, lines = self.unit, []
        for site in self.content["sites"]:
            deposit, path = site.get("deposit"), site.get("path")
            if deposit is None:
                continue
            line = f"site {site['id']}: deposit {deposit['volume']:.5g} {unit}³, stock {deposit['stock_volume']:.4g}"
            if path:
                line += f"; {path['passes']} passes in {path['layers']} layers, {path['minutes']:.3g} min"
            lines.append(line)
        return lines


def format_interval(interval: Sequence[float | None] | None) -> str:
    """An interval in four digits; open at its high end where nothing limits it."""
    if interval is None or interval[0] is None:
        return "unknown"
    low, high = interval[0], interval[1]
    return f"{low:.4g} or more" if high is None else f"{low:.4g} to {high:.4g}"
