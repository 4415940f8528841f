"""What the process for exact solids gets, and how it says where it is."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from damageest.artefacts import Floats, Part
from damageest.stages.export import Body, DepositForm
from damageest_cadquery._assembly import Colour
from damageest_cadquery._exact import SiteInput


@dataclass(frozen=True, eq=False)
class Request:
    """All lengths in millimetres, in the part's frame. ``scale``: millimetres of one length of the CAD file as read.

    ``folder``: where to write, and ``scratch``: where files are until they have been read back; ``places``: prefixes of
    the files with the transform (4,4) to their frame; ``unit``: of the files; ``bodies``: what has no exact form, by
    the stem of its file, for the assembly; ``skipped``: sites that stopped this process before, and why; their deposits
    by the negative of the number; ``left_out``: files that stopped it, by their stem.
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
    skipped: Mapping[int, str]
    left_out: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class CadFacts:
    """``names`` and ``colours`` of the part's CAD faces by number, ``solids``: the names of its solids. A face without
    a name in the file is called by its number, as `damageest faces` lists it."""

    names: Sequence[str]
    colours: Sequence[Colour | None]
    solids: Sequence[str]


def describe_missing(site: SiteInput) -> DepositForm | None:
    """What to say of a deposit whose damage volume has no exact form; None where there is no deposit."""
    return None if site.deposit is None else DepositForm(reason="its damage volume has facets too")


def tell(**what: Any) -> None:
    """Prints a line of JSON for the process that waits."""
    print(json.dumps(what), flush=True)
