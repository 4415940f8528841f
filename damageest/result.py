"""What a run found, as values; `output/` has what result.json says of them."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import (
    AdaptedPart,
    Deposit,
    Deviation,
    Floats,
    Mesh,
    Part,
    Pose,
    Reason,
    Scan,
    Section,
    Solid,
)
from damageest.errors import InputError
from damageest.findings import Coverage, ModelFit, Sensor, Surplus
from damageest.geometry.transforms import invert_pose
from damageest.intervals import Budget, Interval
from damageest.io.conversions import as_manifold, as_trimesh
from damageest.site import Site as Site
from damageest.site import choose_mesh, require_solid


@dataclass(frozen=True)
class StageRecord:
    """One call of a stage; ``site`` 0 for a stage that runs once per job."""

    stage: str
    use: str
    provider: str
    site: Annotated[int, "0 for a stage that runs once per job"]
    seconds: float
    cached: bool


@dataclass(frozen=True)
class StepRecord:
    """Time of a step between the stages, without the stages that it called."""

    step: str
    seconds: Annotated[float, "without the stages that it calls"]


@dataclass(frozen=True, eq=False)
class SoFar:
    """The results of a run until an error ended it; None for values not yet computed. As in `Result`; ``result`` is
    whole where only files failed."""

    part: Part | None = None
    scan: Scan | None = None
    aligned: Scan | None = None
    pose: Pose | None = None
    deviation: Deviation | None = None
    tolerance: float | None = None
    warnings: tuple[Reason, ...] = ()
    result: Result | None = None
    stages: tuple[StageRecord, ...] = ()


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """Everything a run computed. Lengths in ``units``; meshes in the part's frame.

    ``tolerance``: the lambda that was used, in ``units``, also where the job says `auto`. ``pose.T_part_scan`` (4,4)
    takes a point from the scanner's frame to the part's: x_part = R x_scan + t; ``aligned`` is the scan moved by it.
    ``site_label`` (N,) int32 gives each scan point's site, 0 for none. ``damage`` is the union of the DVs of all
    accepted sites and ``undamaged`` the part without them; None where nothing is left or lost. ``volume_95``: None
    where a site of ``damage`` has none; doubtful sites that are no part of ``damage`` are in its high end. ``adapted``:
    deformation of ``part`` to follow the scan; None: it is the part as designed. ``sections``: of the part as designed,
    in the pose of the run. ``conversions``: conversions by plugins, see `convert`. ``scan_factor``: divisor of the
    lengths of ``scan``, for temperature and scale, about ``scan_centre`` (3,); see `transform_to_scan` and
    `raw_points`.
    """

    name: str
    units: str
    tolerance: float
    part: Part
    scan: Scan
    aligned: Scan
    pose: Pose
    deviation: Deviation
    site_label: NDArray[np.int32]
    sites: tuple[Site, ...]
    damage: Solid | None
    undamaged: Solid | None
    warnings: Annotated[tuple[Reason, ...], "notes on the whole run, most important first"]
    failures: Annotated[tuple[str, ...], "sites without a damage volume or a deposit, and why"]
    truth: Floats | None
    stages: tuple[StageRecord, ...] = ()
    steps: Annotated[tuple[StepRecord, ...], "steps between the stages, up to the report"] = ()
    coverage: Coverage | None = None
    surplus: Annotated[tuple[Surplus, ...], "bodies outside the nominal surface, surroundings last"] = ()
    fit: Annotated[ModelFit | None, "null where too few points lie near the skin"] = None
    adapted: AdaptedPart | None = None
    sensor: Annotated[Sensor | None, "null where nothing was measured"] = None
    volume_95: Annotated[
        Interval | None,
        "95 % interval of `damage_volume`, its high end null where nothing limits it; null: there is none",
    ] = None
    budget: Annotated[
        Budget | None,
        "budget of uncertainty of `damage_volume` (JCGM 100); null where there is no interval or no site",
    ] = None
    not_in_budget: Annotated[tuple[str, ...], "sources that the job does not give: not included in any interval"] = ()
    certificate: Annotated[str, "scanner and standard of its certificate; empty where the job has none"] = ""
    sections: Annotated[tuple[Section, ...], "sections of the job"] = ()
    conversions: Mapping[str, Conversion] = field(default_factory=dict, repr=False)
    scan_factor: float = 1.0
    scan_centre: Floats | None = None

    def __repr__(self) -> str:
        levels = ", ".join(f"{site.id} {site.verdict.level}" for site in self.sites) or "none"
        told = f"; {more}" if (more := self.describe_volumes()) else ""
        return f"<Result {self.name}: sites: {levels}; damage volume {self.damage_volume:.6g} {self.units}³{told}>"

    @property
    def status(self) -> Literal["ok", "incomplete"]:
        """Incomplete: some sites have no damage volume or deposit."""
        return "incomplete" if self.failures else "ok"

    @property
    def damage_volume(self) -> float:
        return self.damage.volume if self.damage else 0.0

    @property
    def cut_back_volume(self) -> float:
        """Intact metal that is taken off before deposition, of all accepted sites: by a cut-back, or by `prepare`."""
        return sum(deposit.cut_back_volume for deposit in self._list_deposits())

    @property
    def stock_volume(self) -> float:
        """Volume of the deposits of all accepted sites beyond the part as designed."""
        return sum(deposit.stock_volume for deposit in self._list_deposits())

    @property
    def lost_volume(self) -> float:
        """The volume of missing metal: ``damage_volume`` without any cut-back."""
        within = [one.cut_back_volume for one in self._list_deposits() if one.milled is None and one.cavity is not None]
        return max(self.damage_volume - sum(within), 0.0)

    def describe_volumes(self) -> str:
        """Lost metal, cut-back and stock, each with its name, in ``units``; empty where there is only the first."""
        cubic = f"{self.units}³"
        more = [("cut-back", self.cut_back_volume), ("stock", self.stock_volume)]
        told = [f"{name} {volume:.4g} {cubic}" for name, volume in more if volume > 0]
        return f"lost metal {self.lost_volume:.4g} {cubic}, {', '.join(told)}" if told else ""

    def _list_deposits(self) -> list[Deposit]:
        return [one.deposit for one in self.sites if one.accepted and isinstance(one.deposit, Deposit)]

    @property
    def undamaged_volume(self) -> float:
        return self.undamaged.volume if self.undamaged else 0.0

    def mesh(self, what: str, site: int | None = None) -> Mesh:
        """Without ``site``: part, damage or undamaged; of a site: damage, surface or deposit; `surplus` with the number
        of a surplus. Raises ValueError."""
        if what == "surplus":
            return self._find_surplus(site)
        if site is None:
            found = {"part": self.part, "damage": self.damage, "undamaged": self.undamaged}
            return choose_mesh(found, what, "the result")
        own = next((each for each in self.sites if each.id == site), None)
        if own is None:
            raise ValueError(
                f"there is no site {site}; there are: {', '.join(str(s.id) for s in self.sites) or 'none'}"
            )
        return own.mesh(what)  # type: ignore[arg-type]

    def _find_surplus(self, number: int | None) -> Solid:
        item = next((each for each in self.surplus if each.id == number), None)
        if item is None:
            known = ", ".join(str(each.id) for each in self.surplus) or "none"
            raise ValueError(f"there is no surplus {number}; there are: {known}")
        if item.solid is None:
            raise ValueError(f"surplus {number} has no closed volume" + "".join(f"; {note}" for note in item.notes))
        return item.solid

    def as_trimesh(self, what: str, site: int | None = None, frame: Literal["part", "scan"] = "part") -> Any:
        """A ``trimesh.Trimesh`` in the part's frame or the scanner's; see `mesh`."""
        return as_trimesh(self.mesh(what, site), self._transform_to(frame))

    def as_manifold(self, what: str, site: int | None = None, frame: Literal["part", "scan"] = "part") -> Any:
        """A ``manifold3d.Manifold`` in the part's frame or the scanner's; see `mesh`."""
        return as_manifold(require_solid(self.mesh(what, site), what), self._transform_to(frame))

    def as_cadquery(self, what: str, site: int | None = None) -> Any:
        """A ``cadquery.Shape`` with the faces of the part's CAD file: the part, what is ``undamaged`` of it, or
        the ``damage``, the ``deposit`` or the ``milled`` metal of a site. In the part's frame and in ``units``.

        It takes a part from STEP, IGES or BREP, and some seconds for each site. Raises ValueError for another name,
        InputError where the part has no CAD faces, there is no exact form, or no plugin converts to CadQuery.
        """
        return self.convert("cadquery", what, site)

    def convert(self, kind: str, what: str, site: int | None = None) -> Any:
        """An object of another library, made by a plugin's hook ``damageest_conversions``. ``kind``: the plugin's name
        for it; ``what`` and ``site`` as in `mesh`. Raises InputError where no plugin makes it."""
        if kind not in self.conversions:
            known = ", ".join(sorted(self.conversions)) or "none"
            raise InputError(f"no plugin here converts a result to '{kind}'; there are: {known}")
        return self.conversions[kind](self, what, site)

    def to_dict(self) -> dict[str, Any]:
        """The content of ``result.json``, without files and facts of the run; see its schema."""
        return dict(self.convert("dict", "result"))

    def save(self, folder: str | Path) -> Path:
        """Writes the whole result into a folder, with `to_dict` as ``result.json``; gives it. `load` reads it."""
        from damageest.io.kept_values import keep_value

        place = Path(folder)
        keep_value(place, self, left_out=("conversions",))
        (place / "result.json").write_text(json.dumps(self.to_dict(), indent=1) + "\n", encoding="utf-8")
        return place

    @classmethod
    def load(cls, folder: str | Path) -> Result:
        """A result that `save` wrote. It converts to what trimesh and manifold3d take, not to what plugins make. Raises
        InputError where there is none; a file cannot run code."""
        from damageest.io.kept_values import read_value

        loaded: Result = read_value(Path(folder), cls)
        return replace(loaded, conversions={"dict": partial(_give_kept, Path(folder) / "result.json")})

    def _repr_html_(self) -> str | None:
        """The result in a notebook: its table, sections and a picture. None, so that the notebook shows the text, for a
        result that no run made."""
        show = self.conversions.get("html")
        return None if show is None else str(show(self, "result", None))

    def plot(self, site: int | None = None, show: bool = True) -> Any:
        """Shows the remaining part, the damage volumes and the scan in 3D, by PyVista: in a notebook, else in a window.
        ``site``: look at this one. ``show``: False gives the ``pyvista.Plotter`` instead.

        Raises StageError where PyVista is not installed: the extra `vtk` brings it.
        """
        plotter = self.convert("plotter", "window" if show else "result", site)
        return plotter.show() if show else plotter

    @property
    def transform_to_scan(self) -> Floats:
        """(4,4) takes a point of the part to the scanner's frame. Rigid, but where the lengths of the scan were
        corrected: there it has their factor."""
        T = invert_pose(self.pose)
        if self.scan_factor != 1 and self.scan_centre is not None:
            T[:3, 3] = self.scan_centre + self.scan_factor * (T[:3, 3] - self.scan_centre)
            T[:3, :3] *= self.scan_factor
        return T

    @property
    def raw_points(self) -> Floats:
        """(N,3) the points of the scan as the scanner gave them, in ``units``."""
        if self.scan_factor == 1 or self.scan_centre is None:
            return self.scan.points
        return np.asarray(self.scan_centre + self.scan_factor * (self.scan.points - self.scan_centre))

    def _transform_to(self, frame: str) -> Floats | None:
        """T (4,4) that takes a point of the part to a frame; None for the part's own."""
        if frame not in ("part", "scan"):
            raise ValueError(f"no frame '{frame}'; there are: part, scan")
        return self.transform_to_scan if frame == "scan" else None


def _give_kept(file: Path, result: Result, what: str, site: int | None) -> Any:
    return json.loads(file.read_text(encoding="utf-8"))


Conversion = Callable[[Result, str, int | None], Any]
"""Makes an object of another library from a result, from what `Result.mesh` calls it by: its name, and the number of a
site or None."""
