"""What is known at a point of the route: typed values, each with the key that says how it was computed.

The keys are those of the cache: equal keys mean equal values. A contract's ``gives`` and the parameters of its ``run``
name values of these classes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
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
    Sites,
    Solid,
    Surface,
)
from damageest.checks.coverage import SkinView
from damageest.checks.free_pose import Dependence
from damageest.checks.model_fit import FittedModel
from damageest.checks.uncertainty import SiteError
from damageest.checks.view_fit import ViewFits
from damageest.errors import StageError
from damageest.findings import Coverage, Interval, Surplus, Uncertainty, Verdict
from damageest.pipeline.cache import digest
from damageest.result import Result
from damageest.rules import ScanFacts
from damageest.stages.export import ExportedFiles, PathWriter, Writer
from damageest.stages.report import ReportFiles

T = TypeVar("T")


class Value(Generic[T]):
    """A value of a state. Reading one that no stage or step has given yet raises KeyError."""

    name: str

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, state: None, owner: type) -> Value[T]: ...
    @overload
    def __get__(self, state: State, owner: type) -> T: ...
    def __get__(self, state: State | None, owner: type) -> Any:
        return self if state is None else state.get(self.name)


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

    def with_value(self, value: Value[T], content: T, key: str) -> Self:
        """The state with one more value. Raises ValueError for an empty key."""
        return self.with_named(value.name, content, key)

    def with_named(self, name: str, content: Any, key: str) -> Self:
        """As `with_value`, for a stage's result, whose name its contract gives."""
        if not key:
            raise ValueError(f"the value '{name}' needs a key that says how it was computed")
        return replace(self, values={**self.values, name: content}, keys={**self.keys, name: key})

    def derive(self, value: Value[T], content: T, *sources: Value[Any]) -> Self:
        """The state with a value that follows from the ``sources`` alone."""
        return self.with_value(value, content, digest(value.name, [self.key(source.name) for source in sources]))


@dataclass(frozen=True, eq=False)
class JobState(State):
    """The whole job. ``unit`` and ``tolerance`` are the job's; the tolerance is None until it is measured where the job
    says `auto`. ``aligned``: the scan in the part's frame. ``adapted``: the part deformed to follow the scan, which is
    ``part`` from then on; None: the part as designed. ``intact`` (K,3): its points on the nominal surface.
    ``content``: that of result.json; ``job_text``: that of job.yaml."""

    unit = Value[str]()
    tolerance = Value[float]()
    part = Value[Part]()
    scan = Value[Scan]()
    noise = Value[float]()
    spacing = Value[float]()
    samples = Value[Samples]()
    pose = Value[Pose]()
    aligned = Value[Scan]()
    adapted = Value[AdaptedPart | None]()
    deviation = Value[Deviation]()
    sites = Value[Sites]()
    intact = Value[Floats]()
    skin = Value[SkinView]()
    views = Value[ViewFits | None]()
    corrected_scale = Value[float]()
    fitted = Value[FittedModel | None]()
    coverage = Value[Coverage]()
    facts = Value[ScanFacts]()
    surplus = Value[tuple[Surplus, ...]]()
    volume_95 = Value[Interval | None]()
    enclosures = Value[Enclosures]()
    result = Value[Result]()
    folder = Value[Path]()
    writers = Value[Mapping[str, Writer]]()
    path_writers = Value[Mapping[str, PathWriter]]()
    written = Value[ExportedFiles]()
    content = Value[Mapping[str, Any]]()
    job_text = Value[str]()
    reported = Value[ReportFiles]()

    number = 0
    """That of a site is 1 or more."""


@dataclass(frozen=True, eq=False)
class _SiteState(State):
    """Values of one site; those of the job are read through it."""

    job: JobState = field(default_factory=JobState)
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
    ``displaced``, ``covered``: as in `SiteFacts`; ``uncertainty``: of the volume of ``damage``, and ``error``: the same
    in a form that adds up over the sites; ``dependences``: on the free motions of the pose; ``enclosures``: as in
    `Site`."""

    clusters: tuple[int, ...] = ()
    method: str = ""
    members: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    evidence: Evidence = field(default_factory=Evidence)
    notes: tuple[str, ...] = ()
    refused: bool = False
    verdict: Verdict = field(default_factory=Verdict)
    accepted: bool = True
    displaced: tuple[int, ...] = ()
    covered: tuple[tuple[int, float], ...] = ()
    uncertainty: Uncertainty | None = None
    error: SiteError | None = None
    dependences: tuple[Dependence, ...] = ()
    enclosures: tuple[Solid, ...] = ()

    damage = Value[Solid]()
    others = Value[Solid | None]()
    deposit = Value[Solid | None]()
    body = Value[Solid]()
    left = Value[Solid | None]()
    built = Value[Solid | None]()
    path = Value[DepositPath | None]()


@dataclass(frozen=True, eq=False)
class Work:
    """What goes along the route: the job, the candidates or the sites made of them, failures and warnings.

    ``failures``: the sites that have no damage volume or no deposit. ``wanted``: the clusters to take; None: all.
    """

    job: JobState
    candidates: tuple[Candidate, ...] = ()
    sites: tuple[FoundSite, ...] = ()
    failures: tuple[StageError, ...] = ()
    warnings: tuple[Reason, ...] = ()
    wanted: tuple[int, ...] | None = None
