"""What a doubt is: a rule that measures facts about a site and gives a reason, or none. Public as `damageest.rules`.

The verdict follows from the reasons and from the interval of the volume (`trust/verdict.py`). What a rule measures on
points and triangles is a fact; its reasons follow from the facts alone.
"""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

from damageest.artefacts import Evidence, Flags, Floats, Ints, Pose, Reason, Solid, Vector
from damageest.findings import Coverage, Interval, ModelFit, Uncertainty
from damageest.geometry.scan_field import ScanField
from damageest.trust.skin.coverage import SkinView, find_removed_cells
from damageest.trust.views.view_fit import ViewFits

RULE_FAILED = "rule_failed"
"""The code of the reason that is given instead of those of a rule that failed."""


@dataclass(frozen=True)
class FreePose:
    """A motion that the scan does not exclude, seen from one site: ``text`` names it; ``low``, ``high``: change of the
    site's volume at the ends of the motion; ``moved``: volume between the inner surface before and after it."""

    text: str
    low: float
    high: float
    moved: float


@dataclass(frozen=True)
class ScanFacts:
    """Facts about the whole scan, in the job's ``unit``.

    ``noise``, ``spacing``: of its points. ``seen_area``: skin that the scan shows. ``is_fitted``: whether the pose was
    fitted to the scan, and no unworn skin is known to hold it. ``systematic``: standard deviation of the mean distances
    of intact cells of the skin that noise does not explain. ``outward_area`` and ``outward_height``: area and height of
    skin outside the part by some tolerances. ``between_views``: how far the views differ where they overlap, 0 where
    they agree or are not known. ``sheets_share``: share of its points at which it shows two surfaces, ``sheets_apart``
    from each other. ``pose``: reasons that the stage align gave against its pose. ``fit``: how well the part as
    designed explains the intact skin; None where that was not measured. ``adapted``: by how much the part was deformed
    to follow the scan, 0 where it was not.
    """

    tolerance: float
    spacing: float
    unit: str
    noise: float = 0.0
    seen_area: float = 0.0
    is_fitted: bool = False
    systematic: float = 0.0
    outward_area: float = 0.0
    outward_height: float = 0.0
    between_views: float = 0.0
    sheets_share: float = 0.0
    sheets_apart: float = 0.0
    pose: tuple[Reason, ...] = ()
    fit: ModelFit | None = None
    adapted: float = 0.0


@dataclass(frozen=True)
class SiteFacts:
    """Facts about one site, in the job's unit.

    ``volume``: of its damage volume (DV), and ``interval``: the 95 % interval of it with all terms of ``uncertainty``;
    None where there is none. ``area``: skin that its points cover; ``damage_area``: of the whole surface of the DV;
    ``count``: its scan points; ``typical`` and ``deepest``: median and 95th percentile of their depth below the skin.
    ``evidence``: DV against scan. ``by_rays``: whether rays passed through the metal that it removes. ``rim_unseen``:
    share of its rim beside skin that the scan does not show. ``two_sheets``: share of its points where the scan shows
    another surface above them, on the skin; ``misplaced``: share of its points that a misplaced view explains which was
    not moved; ``one_motion``: whether one motion of them all explains it; ``shifted``: the typical depth of the sites
    of the scan that it explains. ``shallow``: number of shallow sites that are not much smaller. ``contradicted``:
    number of other sites that a rule contradicts, and ``contradicted_share`` of all volume that was found in them; both
    0 when a rule is asked first, and told when it is asked again. ``elsewhere``: share
    of its depth that a motion explains which puts no other skin outside. ``other_poses``: share of its skin that is not
    skin in another pose that fits as well. ``free``: motions that the scan leaves free. ``displaced``: numbers of the
    surplus as large as the loss, ``twins`` of that of the same shape elsewhere. ``bent_wall``: thickness of a wall that
    may be dented there, else 0. ``edges``: share of all sharp edges along which it runs; ``rounded``: the typical depth
    of the sites that run along nearly all. ``covered``: numbers and areas of the surplus on its skin. ``beyond``:
    volume that no scan point shows, and ``beyond_words``: how it was found, ``beyond_at``: where. ``shut`` and
    ``turned``: shares of its inner surface that could be seen from nowhere, and only from where the skin beside it was
    not seen.
    ``other_volume``: by the other method; None where that was not asked, NaN where it gave none. ``terms``: of the
    interval, those of plugins among them. ``measured``: what rules of plugins measured, by their names; ``failed``: why
    a rule could not measure, by its code.
    """

    volume: float
    area: float
    damage_area: float
    count: int
    typical: float
    deepest: float
    evidence: Evidence
    interval: Interval | None = None
    uncertainty: Uncertainty | None = None
    by_rays: bool = False
    rim_unseen: float = 0.0
    two_sheets: float = 0.0
    misplaced: float = 0.0
    one_motion: bool = False
    shifted: float = 0.0
    shallow: int = 0
    elsewhere: float = 0.0
    other_poses: float = 0.0
    free: tuple[FreePose, ...] = ()
    displaced: tuple[int, ...] = ()
    twins: tuple[int, ...] = ()
    bent_wall: float = 0.0
    edges: float = 0.0
    rounded: float = 0.0
    covered: tuple[tuple[int, float], ...] = ()
    beyond: float = 0.0
    beyond_words: str = ""
    beyond_at: Vector | None = None
    shut: float = 0.0
    turned: float = 0.0
    other_volume: float | None = None
    contradicted: int = 0
    contradicted_share: float = 0.0
    terms: tuple[Any, ...] = ()
    measured: Mapping[str, Any] = field(default_factory=dict)
    failed: Mapping[str, Reason] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class SiteCase:
    """What a rule measures a site on: its volume ``damage``, its scan points ``members`` (M,), indices into the
    ``field``, and the whole scan with its facts ``scan``.

    ``skin``: in cells, with what the scan shows; ``coverage``: its unseen regions; ``views``: how the scan's views lie,
    None where it has one. ``is_held``: whether sound datums hold the ``pose``.
    """

    damage: Solid
    members: Ints
    field: ScanField
    scan: ScanFacts
    skin: SkinView
    coverage: Coverage
    pose: Pose
    views: ViewFits | None = None
    is_held: bool = False

    @property
    def points(self) -> Floats:
        """(M,3) the scan points of the site, in the part's frame."""
        return self.field.points[self.members]

    @cached_property
    def removed(self) -> Flags:
        """(C,) the cells of the skin that the site removes."""
        return find_removed_cells(self.damage, self.skin)


class Rule(ABC):
    """One rule.

    ``code``: of the reasons that it gives; a rule of a plugin gives no others. ``meaning``: what the reason says;
    ``threshold``: when it is given; ``remedy``: what to do. All three are printed in the documentation. ``topic``: of
    `damageest explain`, which it belongs to. ``rank``: reasons of equal effect are listed by it, the lowest first.
    """

    code: ClassVar[str]
    meaning: ClassVar[str]
    threshold: ClassVar[str]
    remedy: ClassVar[str] = ""
    topic: ClassVar[str] = ""
    rank: ClassVar[int] = 100
    owner: str = ""
    """The plugin that it is from, which the registry sets; empty for those of damageest."""

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        if "ask" in vars(cls) and "find_reasons" not in vars(cls):
            text = f"{cls.__qualname__}: the method ask of a Rule is called find_reasons since 1.0; rename it"
            warnings.warn(text, DeprecationWarning, stacklevel=2)
            cls.find_reasons = vars(cls)["ask"]  # type: ignore[method-assign]

    def measure(self, case: SiteCase) -> Mapping[str, Any]:
        """The facts that this rule measures on points and triangles, by their names in `SiteFacts`; those of a plugin's
        rule are in ``measured`` there."""
        return {}

    def compare(self, site: SiteFacts, each: Sequence[SiteFacts], scan: ScanFacts) -> Mapping[str, Any]:
        """The facts about a site that follow from those of ``each`` site, itself among them; named as by `measure`."""
        return {}

    @abstractmethod
    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        """The reasons that these facts give, most often none or one."""
