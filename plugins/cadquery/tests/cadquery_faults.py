"""What OpenCASCADE may do, for the process for exact solids, which serves one request."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from damageest_cadquery import _sites, _worker
from damageest_cadquery._request import Made, Request
from damageest_cadquery.cutting import exact_damage as _exact

Find = Callable[..., Any]


def abort_at_second(request: Request) -> Made:
    """Aborts at site 2."""

    def find_or_abort(find: Find, site: Any, *rest: Any) -> Any:
        if site.number == 2:
            os.abort()
        return find(site, *rest)

    return make_with(find_or_abort, request)


def raise_at_second(request: Request) -> Made:
    """Raises at site 2 what no one expects."""

    def find_or_raise(find: Find, site: Any, *rest: Any) -> Any:
        if site.number == 2:
            raise RuntimeError("Standard_NoSuchObject")
        return find(site, *rest)

    return make_with(find_or_raise, request)


def compute_on_at_first(request: Request) -> Made:
    """Computes without end at site 1."""

    def find_or_compute(find: Find, site: Any, *rest: Any) -> Any:
        while site.number == 1:
            pass
        return find(site, *rest)

    return make_with(find_or_compute, request)


def abort_with_shapes(request: Request) -> Made:
    """Aborts where solids are split by recognised shapes."""
    return _split_with(os.abort, ("shapes",), request)


def abort_with_any(request: Request) -> Made:
    """Aborts at site 1 where solids are split by whatever is tried."""
    return _split_with(os.abort, ("shapes", "spline", "planes", "facets"), request, 1)


def compute_on_with_shapes(request: Request) -> Made:
    """Computes without end where solids are split by recognised shapes."""

    def compute() -> None:
        while request:
            pass

    return _split_with(compute, ("shapes",), request)


def _split_with(fault: Callable[[], None], kinds: tuple[str, ...], request: Request, site: int | None = None) -> Made:
    split = _exact._Work.split

    def split_or_fail(work: Any, tool: Any, kind: str, fuzzy: float) -> Any:
        if kind in kinds and site in (None, work.site.number):
            fault()
        return split(work, tool, kind, fuzzy)

    vars(_exact)["_Work"].split = split_or_fail
    return _worker.make_exact(request)


def compute_on_while_adapting(request: Request) -> Made:
    """Computes without end while faces are moved."""

    def compute(*values: Any) -> Any:
        while values:
            pass

    vars(_worker)["move_solids"] = compute
    return _worker.make_exact(request)


def abort_at_start(request: Request) -> Made:
    """Aborts before the first site, each time."""
    os.abort()


def find_none_beyond(request: Request) -> Made:
    """Finds no exact form for sites beyond x = 20."""

    def find_or_fail(find: Find, site: Any, *rest: Any) -> Any:
        return (None, ("forced to fail",)) if site.damage.bounds[0, 0] > 20 else find(site, *rest)

    return make_with(find_or_fail, request)


def abort_at_opened(request: Request) -> Made:
    """Aborts where an opened cavity, which no scan has seen, is cut out."""

    def find_or_abort(find: Find, site: Any, *rest: Any) -> Any:
        if not len(site.points):
            os.abort()
        return find(site, *rest)

    return make_with(find_or_abort, request)


def abort_at_milled(request: Request) -> Made:
    """Aborts where the damage volume is cut out of an opened cavity."""
    vars(_sites)["find_milled"] = lambda *values: os.abort()
    return _worker.make_exact(request)


def make_with(replaced: Callable[..., Any], request: Request) -> Made:
    """As `make_exact`, with ``replaced`` in the place of `find_exact`, which it gets as its first argument."""
    names = vars(_sites)
    find = names["find_exact"]
    names["find_exact"] = lambda *values: replaced(find, *values)
    return _worker.make_exact(request)
