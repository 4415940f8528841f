"""Tries what plugins bring beside stages on small examples: rules, terms, formats of solids and paths, documents."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from damageest.artefacts import DepositPath
    from damageest.registry import Registry
    from damageest.result import Result
    from damageest.stages.export import Body, Writer

SECONDS = 60.0
"""How long a trial may take."""
WORKER = "damageest doctor"


def try_plugins(registry: Registry, result: Result | None = None, apart: bool = False) -> tuple[int, list[str]]:
    """How many rules, terms and formats of plugins were tried, and what goes wrong. ``result``: of a small run, for
    formats that hold a result as a whole; without it they are left out. ``apart``: in a process of its own, which a
    plugin may crash or hang."""
    trials = list_trials(registry, with_result=result is not None)
    with TemporaryDirectory(prefix="damageest-") as folder:
        kept = "" if result is None else str(result.save(folder))
        if not apart:
            return len(trials), [fault for kind, name, _ in trials for fault in try_one(kind, name, kept, registry)]
        return len(trials), [fault for each in trials for fault in _try_apart(*each, kept)]


def list_trials(registry: Registry, with_result: bool = True) -> list[tuple[str, str, str]]:
    """What can be tried: its kind, its code or name, and what to call it."""
    from damageest.registry.guards import name_guarded
    from damageest.trust.verdict import name_told

    trials = [("rule", rule.code, name_told(rule)) for rule in registry.rules if rule.owner]
    trials += [("term", term.name, name_told(term)) for term in registry.terms if term.owner]
    for name, writer in registry.writers.items():
        if (called := name_guarded(writer.write)) and (with_result or not writer.document):
            trials.append(("format", name, called))
    for name, path_writer in registry.path_writers.items():
        if called := name_guarded(path_writer.write):
            trials.append(("path", name, called))
    return trials


def _try_apart(kind: str, name: str, called: str, kept: str) -> list[str]:
    """As `try_one`; where the process ends, what ended it is the fault."""
    from damageest.isolation import Limits, ProcessError, call_isolated

    arguments = {"kind": kind, "name": name, "kept": kept}
    try:
        return call_isolated(try_one, arguments, worker=WORKER, limits=Limits(seconds=SECONDS), show=False)
    except ProcessError as error:
        why = f"took longer than {SECONDS:g} s" if error.why == "time" else error.message
        return [f"{called}: {why}; try: report it to its authors, or uninstall it"]


def try_one(kind: str, name: str, kept: str, registry: Registry | None = None) -> list[str]:
    """What goes wrong with a rule, a term or a format on a small example. ``kept``: the folder of a saved result."""
    from damageest.errors import DamageestError
    from damageest.registry import Registry

    registry = registry or Registry.discover()
    if kind in ("rule", "term"):
        return _try_rule(registry, name) if kind == "rule" else _try_term(registry, name)
    with TemporaryDirectory(prefix="damageest-") as folder:
        try:
            if kind == "path":
                _try_path(registry, name, Path(folder))
            else:
                _try_writer(registry.writers[name], name, Path(folder), kept)
        except (DamageestError, OSError) as error:
            # a format of paths may refuse a path without a machine
            return [f"export: {error}"] if kind != "path" or getattr(error, "code", "") == "faulty" else []
    return []


def _try_rule(registry: Registry, code: str) -> list[str]:
    from damageest.rules import RULE_FAILED
    from damageest.trust.example import make_site
    from damageest.trust.verdict import apply_rules, compare_sites, measure_facts

    own = [rule for rule in registry.rules if rule.code == code]
    facts, case, _ = make_site()
    (facts,) = compare_sites(own, [measure_facts(own, case, facts)], case.scan)
    reasons = apply_rules(own, facts, case.scan)
    return [f"{one.text}; try: {one.remedy}" for one in reasons if one.code == RULE_FAILED]


def _try_term(registry: Registry, name: str) -> list[str]:
    from damageest.errors import StageError
    from damageest.trust.example import make_site
    from damageest.trust.interval.uncertainty import measure_term

    (term,) = [term for term in registry.terms if term.name == name]
    try:
        measure_term(term, make_site()[2])
    except StageError as error:
        return [f"{error.message}; try: {error.remedy}"]
    return []


def _try_writer(writer: Writer, name: str, folder: Path, kept: str) -> None:
    from damageest.result import Result
    from damageest.stages.export import Patch

    if writer.document:
        writer.document(folder, Result.load(kept))
        return
    writer.write(folder, "box", _make_bodies(2 if writer.one_file else 1), "mm")
    if writer.patch:
        corners = np.array([[[0.0, 0, 0], [0, 3, 0]], [[4, 0, 0], [4, 3, 1]]])
        ends = np.array([0.0, 0, 1, 1])
        writer.patch(folder / f"patch.{name}", "patch", Patch(1, (ends, ends), corners), "mm")


def _try_path(registry: Registry, name: str, folder: Path) -> None:
    from damageest.stages.export import PathSettings

    writer, settings = registry.path_writers[name], PathSettings("mm", "doctor, site 1")
    if writer.check:
        writer.check(settings, ())
    writer.write(folder / f"site-1.{writer.suffix}", _make_path(), settings)


def _make_bodies(count: int) -> list[Body]:
    """Boxes side by side."""
    from manifold3d import Manifold

    from damageest.artefacts import Solid
    from damageest.geometry.solids import to_arrays
    from damageest.stages.export import Body

    boxes = [Manifold.cube((4, 3, 2)).translate((6 * k, 0, 0)) for k in range(count)]
    return [Body(f"box {k + 1}", Solid(*to_arrays(box)), (200, 60, 50)) for k, box in enumerate(boxes)]


def _make_path() -> DepositPath:
    """Two passes in one layer."""
    from damageest.artefacts import DepositPath, Mesh

    points = np.array([[0.0, 0, 5], [0, 0, 1], [10, 0, 1], [10, 2, 1], [0, 2, 1], [0, 2, 5]])
    up, count = np.tile([0.0, 0.0, 1.0], (len(points), 1)), len(points)
    ones: Any = np.ones(count, int)
    corners = np.array([[0.0, 0, 0], [1, 0, 4], [-1, 1, 4], [-1, -1, 4]])
    nozzle = Mesh(corners, np.array([[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]]))
    return DepositPath(
        points, up, up, np.full(count, 600.0), np.array([False, False, True, False, True, False]), ones,
        np.array([1, 1, 1, 2, 2, 2]), ones, up[:1], np.ones(1), 2.0, np.ones(1), 3.0, 40.0, nozzle, 1.0, 1.0,
    )  # fmt: skip
