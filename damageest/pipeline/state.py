"""What is known at a point of the route: typed values, each with the key that says how it was computed.

The keys are those of the cache: equal keys mean equal values. A contract's ``gives`` and the parameters of its ``run``
name values of these classes.
"""

from __future__ import annotations

import typing
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Generic, Self, TypeVar, overload

import numpy as np

from damageest.artefacts import (
    AdaptedPart,
    DepositPath,
    Deviation,
    Enclosures,
    Evidence,
    Floats,
    Ints,
    Mesh,
    Part,
    Pose,
    Reason,
    Rims,
    Samples,
    Scan,
    Section,
    Sites,
    Solid,
    Surface,
)
from damageest.errors import StageError
from damageest.findings import Budget, Coverage, Explained, Interval, Sensor, Surplus, Uncertainty, Verdict
from damageest.geometry.lost_depth import measure_lost_depth
from damageest.geometry.scan_field import ScanField
from damageest.job.model import Accept, SiteChoice
from damageest.job.scanner import ScannerInfo, Temperature
from damageest.job.sections import SectionChoice
from damageest.pipeline.cache import digest
from damageest.pipeline.registration import Registration
from damageest.result import Conversion, Result
from damageest.rules import Rule, Term
from damageest.stages.adapt import Adapt
from damageest.stages.align import Align
from damageest.stages.enclose import Enclose, EncloseAll
from damageest.stages.export import ExportedFiles, PathWriter, Writer
from damageest.stages.report import ReportFiles
from damageest.stages.scan import ReadScan
from damageest.stages.segment import Segment
from damageest.trust.beyond_points import BeyondPoints
from damageest.trust.interval.free_pose import Dependence
from damageest.trust.interval.loss import ScanErrors
from damageest.trust.interval.site_error import SiteError
from damageest.trust.model_fit import AskedFit, FittedModel
from damageest.trust.skin.coverage import SkinView
from damageest.trust.views.two_sheets import Sheets
from damageest.trust.views.view_fit import ViewFits

MADE_OF = {
    "field": ("part", "aligned", "deviation", "tolerance"),
    "intact": ("part", "aligned", "deviation", "tolerance"),
    "noise": ("aligned",),
    "spacing": ("aligned",),
    "registration": tuple(one.name for one in fields(Registration)),
}
"""Values that are made of others, and as new as these. No step gives them; one that gives a registration gives what it
is made of."""

T = TypeVar("T")
Failures = Sequence[StageError]
Reasons = Sequence[Reason]


class Value(Generic[T]):
    """A value of a state. Reading one that no stage or step has given yet raises KeyError."""

    name: str

    @property
    def kind(self) -> Any:
        """The type of the value, as declared."""
        return typing.get_args(getattr(self, "__orig_class__"))[0]  # noqa: B009

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, state: None, owner: type) -> Value[T]: ...
    @overload
    def __get__(self, state: State, owner: type) -> T: ...
    def __get__(self, state: State | None, owner: type) -> Any:
        return self if state is None else state.get(self.name)


def list_given(names: Iterable[str]) -> list[str]:
    """The names of values that are given, for those that are made of them too; each once, in their order."""
    return list(dict.fromkeys(given for name in names for given in MADE_OF.get(name, (name,))))


@dataclass(frozen=True, eq=False)
class State:
    """Values by name with their keys. Immutable: each change gives a new state."""

    values: Mapping[str, Any] = field(default_factory=dict, repr=False)
    keys: Mapping[str, str] = field(default_factory=dict, repr=False)

    def get(self, name: str) -> Any:
        return self.values[name]

    def key(self, name: str) -> str:
        """The key of a value, for the cache."""
        return self.keys[name]

    def with_value(self, value: Value[T], content: T, key: str | None = None) -> Self:
        """The state with one more value. Without a ``key``, its content is the key. Raises ValueError for an empty
        key."""
        return self.with_named(value.name, content, digest(content) if key is None else key)

    def with_named(self, name: str, content: Any, key: str) -> Self:
        """As `with_value`, for a value whose name a contract or a step gives."""
        if not key:
            raise ValueError(f"the value '{name}' needs a key that says how it was computed")
        return replace(self, values={**self.values, name: content}, keys={**self.keys, name: key})

    def select(self, names: Iterable[str]) -> Self:
        """The state with the values of these names alone."""
        chosen = list_given(names)
        return replace(
            self, values={name: self.get(name) for name in chosen}, keys={name: self.key(name) for name in chosen}
        )


@dataclass(frozen=True, eq=False)
class _SiteState(State):
    """Values of one site. ``job``: those of the job, read through it where a contract is called on the site."""

    job: JobState = field(default_factory=lambda: JobState())
    number: int = 0

    def get(self, name: str) -> Any:
        return self.values[name] if name in self.values else self.job.get(name)

    def key(self, name: str) -> str:
        return self.keys[name] if name in self.keys else self.job.key(name)


@dataclass(frozen=True, eq=False)
class Candidate(_SiteState):
    """One cluster of damaged points, or one enclosure, on its way to a damage volume.

    ``clusters``: the numbers of the point clusters it stands for; ``method``: the implementation that enclosed it, or
    `surface`; ``notes``: what its enclosure's maker doubts.
    """

    clusters: tuple[int, ...] = ()
    method: str = ""
    notes: tuple[str, ...] = ()

    points = Value[Floats]()
    fine = Value[bool]()
    surface = Value[Surface]()
    rims = Value[Rims]()
    background = Value[Solid]()
    enclosure = Value[Mesh]()
    solid = Value[Solid]()
    damage = Value[Solid | None]()


@dataclass(frozen=True, eq=False)
class FoundSite(_SiteState):
    """A site with its damage volume. ``members`` (M,): its scan points; ``refused``: `allowance` gave no deposit;
    ``verdict``: what the damage volume is worth; ``accepted``: whether it is part of the result's damage;
    ``displaced``, ``twins``, ``bent_wall``, ``covered``: as in `SiteFacts`; ``uncertainty``: of the volume of
    ``damage``, and ``error``: the same in a form that adds up over sites; ``beyond``: how it lies against its points;
    ``dependences``: on the free motions of the pose; ``enclosures``: as in `Site`; ``other_volume``: by the method that
    did not make it; None where that was not asked, NaN where it gave none."""

    clusters: tuple[int, ...] = ()
    method: str = ""
    members: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    evidence: Evidence = field(default_factory=Evidence)
    notes: tuple[str, ...] = ()
    refused: bool = False
    verdict: Verdict = field(default_factory=Verdict)
    accepted: bool = True
    displaced: tuple[int, ...] = ()
    twins: tuple[int, ...] = ()
    bent_wall: float = 0.0
    covered: tuple[tuple[int, float], ...] = ()
    uncertainty: Uncertainty | None = None
    error: SiteError | None = None
    beyond: BeyondPoints = field(default_factory=BeyondPoints)
    dependences: tuple[Dependence, ...] = ()
    enclosures: tuple[Solid, ...] = ()
    other_volume: float | None = None

    damage = Value[Solid]()
    others = Value[Solid | None]()
    deposit = Value[Solid | None]()
    body = Value[Solid]()
    left = Value[Solid | None]()
    built = Value[Solid | None]()
    path = Value[DepositPath | None]()

    def measure_depth(self, field: ScanField) -> float:
        """The largest depth of its scan points below the lost skin; 0 without any."""
        return measure_lost_depth(self.damage, field.part, field.points[self.members])


@dataclass(frozen=True, eq=False)
class JobState(State):
    """The whole job, as it goes along the route.

    From the job and the registry: ``name``, ``unit``, ``asked_tolerance`` (None: `auto`), ``choice`` of sites,
    ``accept``, ``asked_sections``, ``scanner`` and ``temperature`` (None: the job does not tell), the stages whose
    options steps read (None where the job's route has none), and ``rules``, ``terms``, ``writers``, ``path_writers``,
    ``reach`` (see the stage `path`) and ``conversions``. ``tolerance``: None until it is measured where the job says
    `auto`. ``measured_noise`` and
    ``measured_spacing``: of the scan before it is aligned; ``depth_step``: of its depth, 0 where it is continuous.
    ``refusal``: why `align` gave no pose in the tolerance, where the pose is one in a larger. ``aligned``: the scan in
    the part's frame. ``adapted``: the part deformed to follow the scan, which is ``part`` from then on; None: it is as
    designed. ``asked_fit``: how it fits, where that was asked before. ``intact`` (K,3): those of the field. ``wanted``:
    the clusters to enclose; None: all. ``candidates``: what may become a site, ``found``: the sites. ``failures``: the
    sites that have no damage volume or no deposit. ``folder``: that the files are written into, ``target``: that they
    will be in. ``content``: that of result.json; ``job_text``: that of job.yaml. ``thermal_scale``: what the scan was
    divided by for the part's temperature, about ``scan_centre`` (3,). ``field``: part, aligned scan, deviation and
    tolerance as one value, which no step gives: it is that of the state. ``errors``: that all sites have in
    common; ``budget``: of the total volume. ``sheets``: two surfaces over the same skin;
    ``explained``: places that views which lie apart explain, no sites.
    """

    made: dict[str, ScanField] = field(default_factory=dict, repr=False)
    """The last field by its key, shared by all states of a run: what it computes is computed once."""

    name = Value[str]()
    unit = Value[str]()
    asked_tolerance = Value[float | None]()
    choice = Value[SiteChoice]()
    accept = Value[Accept]()
    asked_sections = Value[tuple[SectionChoice, ...]]()
    reader = Value[ReadScan | None]()
    scanner = Value[ScannerInfo | None]()
    temperature = Value[Temperature | None]()
    aligner = Value[Align | None]()
    adapter = Value[Adapt | None]()
    segmenter = Value[Segment | None]()
    encloser = Value[Enclose | None]()
    encloser_at_once = Value[EncloseAll | None]()
    rules = Value[tuple[Rule, ...]]()
    terms = Value[tuple[Term, ...]]()
    writers = Value[Mapping[str, Writer]]()
    reach = Value[Floats | None]()
    path_writers = Value[Mapping[str, PathWriter]]()
    conversions = Value[Mapping[str, Conversion]]()

    tolerance = Value[float]()
    part = Value[Part]()
    scan = Value[Scan]()
    measured_noise = Value[float]()
    measured_spacing = Value[float]()
    depth_step = Value[float]()
    noise = Value[float]()
    spacing = Value[float]()
    samples = Value[Samples | None]()
    nearby = Value[Samples | None]()
    pose = Value[Pose]()
    refusal = Value[StageError | None]()
    aligned = Value[Scan]()
    registration = Value[Registration]()
    adapted = Value[AdaptedPart | None]()
    asked_fit = Value[AskedFit | None]()
    deviation = Value[Deviation]()
    field = Value[ScanField]()
    sites = Value[Sites]()
    intact = Value[Floats]()
    skin = Value[SkinView]()
    views = Value[ViewFits | None]()
    corrected_scale = Value[float]()
    thermal_scale = Value[float]()
    scan_centre = Value[Floats]()
    fitted = Value[FittedModel | None]()
    coverage = Value[Coverage]()
    errors = Value[ScanErrors]()
    sensor = Value[Sensor]()
    folded = Value[float]()
    sheets = Value[Sheets]()
    explained = Value[Explained]()
    surplus = Value[tuple[Surplus, ...]]()
    volume_95 = Value[Interval | None]()
    budget = Value[Budget | None]()
    sections = Value[tuple[Section, ...]]()
    enclosures = Value[Enclosures]()

    wanted = Value[tuple[int, ...] | None]()
    candidates = Value[tuple[Candidate, ...]]()
    found = Value[tuple[FoundSite, ...]]()
    failures = Value[Failures]()
    warnings = Value[Reasons]()

    result = Value[Result]()
    folder = Value[Path]()
    target = Value[Path]()
    written = Value[ExportedFiles]()
    content = Value[Mapping[str, Any]]()
    job_text = Value[str]()
    reported = Value[ReportFiles]()

    number = 0
    """That of a site is 1 or more."""

    def get(self, name: str) -> Any:
        if name in ("field", "intact"):
            return self._make_field() if name == "field" else self._make_field().intact
        if name in ("noise", "spacing"):
            return getattr(self.aligned, name)
        if name == "registration":
            return Registration(*(self.get(one) for one in MADE_OF[name]))
        return super().get(name)

    def key(self, name: str) -> str:
        return digest([self.key(one) for one in MADE_OF[name]]) if name in MADE_OF else super().key(name)

    def _make_field(self) -> ScanField:
        key = self.key("field")
        if key not in self.made:
            self.made.clear()
            self.made[key] = ScanField(self.part, self.aligned, self.deviation, self.tolerance)
        return self.made[key]
