"""What the process for exact solids gets, and what it gives."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from damageest.artefacts import Deposit, DisplacementField, Floats, Part
from damageest.stages.export import Body, DepositForm, ExactForm, MilledForm
from damageest_cadquery.cutting.exact_damage import SiteInput
from damageest_cadquery.writing.assembly import Colour


@dataclass(frozen=True, eq=False)
class Request:
    """All lengths in millimetres, in the part's frame. ``scale``: millimetres of one length of the CAD file as read.

    ``folder``: where to write, and ``scratch``: where files are until they have been read back; ``places``: prefixes of
    the files with the transform (4,4) to their frame; ``unit``: of the files; ``bodies``: what has no exact form, by
    the stem of its file, for the assembly, which ``assembly`` asks for; ``field``: what moves the part as designed, as
    its CAD file has it, to ``part``, None for nothing; ``seconds``: processor time that each piece of work has;
    ``skipped``: those that stopped this process before, by `name_site`, `name_form`, `name_deposit` and `name_file`,
    and why. ``enlarged``: all lengths, but those of ``places``, are millimetres times this. ``keep``: the folder of
    what earlier processes have found, empty for none. ``left``: processor seconds that this process has for everything,
    and ``solving``, until it begins no further site.
    """

    part: Part
    scale: float
    tolerance: float
    unit: str
    sites: tuple[SiteInput, ...]
    bodies: Mapping[str, Body]
    folder: str
    scratch: str
    places: Mapping[str, Floats | None]
    seconds: float
    assembly: bool = True
    enlarged: float = 1.0
    field: DisplacementField | None = None
    skipped: Mapping[str, str] = dataclasses.field(default_factory=dict)
    keep: str = ""
    left: float = math.inf
    solving: float = math.inf

    def allow(self, seconds: float, share: float | None = None) -> float:
        """How much of ``seconds`` of the processor a piece of work may take now. ``share``: what all work up to it may
        take; by default all that this process has."""
        left = (self.left if share is None else share) - time.process_time()
        return max(min(seconds, left), LEAST)


@dataclass(frozen=True)
class Made:
    """The ``files`` that the process wrote, what is to be said of them, and the ``forms`` of all sites by number."""

    files: tuple[str, ...]
    notes: tuple[str, ...]
    forms: Mapping[int, ExactForm]


LEAST = 0.5
"""Processor seconds that a piece of work has at least: it is ended at once where there is no time left."""
SPENT = "the time for exact forms (export.exact_seconds) was used up"
WHOLE = "the CAD file"
"""The work between the others, such as reading."""
ADAPTING = "the CAD faces of the adapted part"
"""The work of moving them."""


def name_site(number: int) -> str:
    return f"site {number}"


def name_form(whose: str, form: str) -> str:
    """``form``: of a damage volume or an opened cavity, as it is tried: of recognised shapes and splines the kind
    alone."""
    kind = form.split()[0]
    return f"{kind if kind in ('shapes', 'spline') else form} for {whose}"


def limit_form(seconds: float) -> float:
    """How long a form of a damage volume or an opened cavity may take of the ``seconds`` of a site: others are to be
    tried after it."""
    return seconds / 2


def name_deposit(number: int) -> str:
    return f"deposit of site {number}"


def name_opened(number: int) -> str:
    """The cavity that is opened before deposition; its forms are those of this name."""
    return f"the opened cavity of site {number}"


def name_milled(number: int) -> str:
    return f"metal to mill off at site {number}"


def name_crossed(number: int) -> str:
    """The look for the reason in the CAD file."""
    return f"faces that cross at site {number}"


def name_file(stem: str) -> str:
    return f"{stem}.step"


@dataclass(frozen=True, eq=False)
class CadFacts:
    """``names`` and ``colours`` of the part's CAD faces by number, ``solids``: the names of its solids. A face without
    a name in the file is called by its number, as `damageest faces` lists it."""

    names: Sequence[str]
    colours: Sequence[Colour | None]
    solids: Sequence[str]


def describe_none(site: SiteInput, why: str) -> ExactForm:
    """What to say of a site where nothing has an exact form."""
    return ExactForm("none", tried=(why,), deposit=describe_missing(site), milled=describe_unmilled(site))


def describe_missing(site: SiteInput, what: str = "damage volume") -> DepositForm | None:
    """What to say of a deposit whose damage volume, or opened cavity, has no exact form; None where there is no
    deposit."""
    return None if site.deposit is None else DepositForm(reason=f"its {what} has facets too")


def describe_unmilled(site: SiteInput, tried: Sequence[str] = ()) -> MilledForm | None:
    """What to say of metal to mill off whose cavity has no exact form; None where the cavity was not opened."""
    opened = isinstance(site.deposit, Deposit) and site.deposit.milled is not None
    why = tried[-1] if tried else "its damage volume has facets too"
    return MilledForm("none", tried=tuple(tried), reason=why) if opened else None
