"""Steps name what they take and give: wrong names are errors on import, the route is shown as it is, keys follow."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from damageest.artefacts import Floats, Part, Pose, Reason, Scan
from damageest.geometry.scan_field import ScanField
from damageest.job import load
from damageest.pipeline import routes
from damageest.pipeline.begin import start
from damageest.pipeline.cache import Cache, digest
from damageest.pipeline.engine import Branch, Engine, Route
from damageest.pipeline.placing.prepare import place_scan
from damageest.pipeline.registration import Registration
from damageest.pipeline.state import MADE_OF, Candidate, FoundSite, JobState, Reasons, Value, list_given
from damageest.pipeline.steps import GATHERED, Step, find_value, step
from damageest.registry import Registry
from damageest.registry.contracts import Contract
from damageest.stages.allowance import Allowance
from tests import damaged_box

ROOT = Path(__file__).parents[2]
PARTS = ("ACQUIRE", "BY_SITE", "AT_ONCE", "CLOSE", "WRITE")
METHODS = ("auto", "both", "surface", "implicit")
POINTS = np.arange(12.0).reshape(4, 3)


def walk(route: Route) -> Iterator[Contract | Step[..., Any] | Branch]:
    """All items of a route, a branch before what is in it."""
    for item in route:
        yield item
        if isinstance(item, Branch):
            for inner in item.routes:
                yield from walk(inner)


def name_of(item: Contract | Step[..., Any] | Branch) -> str:
    return item.__name__ if isinstance(item, type) else item.name


def takes(item: Contract | Step[..., Any] | Branch) -> tuple[str, ...]:
    return item.reads if isinstance(item, Branch) else item.takes if isinstance(item, Step) else tuple(item.takes())


def describe(item: Contract | Step[..., Any] | Branch) -> str:
    """What the comment beside an item of a route says."""
    if isinstance(item, Branch):
        return ", ".join(item.reads)
    if not isinstance(item, Step):
        return f"{', '.join(item.takes())} -> {item.gives}"
    calls = f"calls {', '.join(one.__name__ for one in item.calls)}: " if item.calls else ""
    gives = [f"+{name}" if name in GATHERED and name not in item.takes else name for name in item.gives]
    return f"{calls}{', '.join(item.takes)} -> {', '.join(gives)}".strip()


STEPS = {item.name: item for part in PARTS for item in walk(getattr(routes, part)) if isinstance(item, Step)}


@pytest.mark.parametrize("part", PARTS)
def test_the_routes_say_what_flows(part: str) -> None:
    text = inspect.getsource(routes).split(f"\n{part}: Route = (\n")[1].split("\n)\n")[0]
    told = re.findall(r"(\w+)[,(]  # (.*(?:\n +# .*)*)", text)
    wanted = [(name_of(item), describe(item)) for item in walk(getattr(routes, part))]
    assert [(name, re.sub(r"\s+(# *)?", " ", flow).strip()) for name, flow in told] == wanted


@pytest.mark.parametrize("name", ["part", "pose", "aligned", "tolerance", "registration", "deviation", "intact"])
def test_a_reader_knows_which_value_of_a_name_is_meant(name: str) -> None:
    """Few items of a route give it; corrections of where the scan lies give a registration."""
    items = {item for method in METHODS for item in walk(routes.route_of(method)) if not isinstance(item, Branch)}
    giving = {name_of(item) for item in items if name in (item.gives if isinstance(item, Step) else (item.gives,))}
    assert len(giving) <= 3, giving


def test_the_architecture_page_names_all_of_the_route_in_order() -> None:
    shown = (ROOT / "ARCHITECTURE.md").read_text().split("## The route")[1].split("```")[1]
    names = re.findall(r"\b\w+\b", re.sub(r"\[.*?\]| {3,}\S+\.py.*", "", shown))
    wanted = [name_of(item) for part in PARTS for item in walk(getattr(routes, part))]
    assert [name for name in names if name in wanted] == wanted


@pytest.mark.parametrize("method", METHODS)
def test_what_is_taken_was_given_before(method: str, registry: Registry, tmp_path: Path) -> None:
    """On each route, by each step and contract."""
    damaged_box.write(tmp_path)
    known = {*start(Engine(load(tmp_path / "job.yaml", registry), registry)).values, "folder", "target"}
    for item in walk((*routes.route_of(method), *routes.WRITE)):
        called = not isinstance(item, (Step, Branch)) and item.per_site
        missing = [
            name for name in list_given(takes(item)) if name not in known and not (called and hasattr(Candidate, name))
        ]
        assert not missing, name_of(item)
        known |= {*item.gives} if isinstance(item, Step) else set() if isinstance(item, Branch) else {item.gives}


@pytest.mark.parametrize("name", [name for name, item in STEPS.items() if "state" in item.passed])
def test_a_step_with_a_state_names_what_it_reads(name: str) -> None:
    """All of it, also in the functions of its module, and nothing that it does not read."""
    item = STEPS[name]
    module = ast.parse(inspect.getsource(inspect.getmodule(item.function)))  # type: ignore[arg-type]
    functions = {node.name: node for node in ast.walk(module) if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
    todo, seen, read = [name], set[str](), set[str]()
    while todo:
        seen.add(current := todo.pop())
        for node in ast.walk(functions[current]):
            if isinstance(node, ast.Attribute) and ast.unparse(node.value) in ("state", "self._state", "turned"):
                read |= {node.attr} if find_value(node.attr) else set()
            if isinstance(node, ast.Name) and node.id in functions and node.id not in seen:
                todo.append(node.id)
    by_contracts = {value for contract in item.calls for value in contract.takes()}
    assert read <= set(item.takes)
    assert set(item.takes) - by_contracts <= read | {"aligned", "sites"}, "these say where a candidate is that fails"


def takes_a_wrong_name(scann: Scan) -> Floats:
    return scann.points


def takes_a_wrong_type(scan: Part) -> Floats:
    return scan.vertices


def gives_a_wrong_type(scan: Scan) -> Scan:
    return scan


def gives_one(scan: Scan) -> Floats:
    return scan.points


def gives_a_wrong_second(scan: Scan) -> tuple[Floats, Pose]:
    return scan.points, Pose(np.eye(4))


@pytest.mark.parametrize(
    ("function", "declared", "text"),
    [
        (takes_a_wrong_name, {"gives": "scan_centre"}, "'scann', which is no value of a job .did you mean 'scan'"),
        (takes_a_wrong_type, {"gives": "scan_centre"}, "takes scan: Part; it is a scan: Scan"),
        (gives_a_wrong_type, {"gives": "scan_centre"}, "gives scan_centre: Scan; it has to be scan_centre: Floats"),
        (gives_one, {"gives": "scan_center"}, "'scan_center', which is no value of a job .did you mean 'scan_centre'"),
        (gives_one, {"gives": "scan_centre", "reads": ("toleranc",)}, "'toleranc', which is no value"),
        (gives_one, {"gives": ("scan_centre", "pose")}, "gives scan_centre, pose, but returns"),
        (gives_one, {}, "gives nothing, but returns"),
        (
            gives_a_wrong_second,
            {"gives": ("scan_centre", "deviation")},
            "gives deviation: Pose; it has to be .*Deviation",
        ),
        (gives_a_wrong_second, {"gives": "scan_centre"}, "gives scan_centre: tuple"),
        (gives_one, {"gives": "intact"}, "gives intact, which is made of part, aligned, deviation, tolerance"),
    ],
)
def test_a_wrong_name_or_type_is_an_error_on_import(function: Any, declared: Any, text: str) -> None:
    with pytest.raises(TypeError, match=rf"step tests.pipeline.test_steps.{function.__name__} .*{text}"):
        step(**declared)(function)


def test_each_value_of_a_state_has_a_type() -> None:
    for kind in (JobState, Candidate, FoundSite):
        values = [value for value in vars(kind).values() if isinstance(value, Value)]
        assert values
        assert all(value.kind is not None for value in values)
    assert JobState.part.kind is Part
    assert JobState.tolerance.kind is float


@pytest.fixture
def engine(registry: Registry, tmp_path: Path) -> Engine:
    damaged_box.write(tmp_path)
    return Engine(load(tmp_path / "job.yaml", registry), registry, Cache(tmp_path / "stages"))


def begin(engine: Engine, scan: str = "s", part: str = "p") -> JobState:
    state = start(engine).with_value(JobState.scan, Scan(POINTS), scan)
    return state.with_value(JobState.part, damaged_box.box(), part)


def test_keys_follow_from_what_a_step_took(engine: Engine) -> None:
    @step(gives=("scan_centre", "corrected_scale", "scan"))
    def derive(scan: Scan, part: Part) -> tuple[Floats, float, Scan]:
        return scan.points, np.float64(0.25), scan

    def keys(state: JobState) -> dict[str, str]:
        done = engine.take(derive, state)
        return {name: done.key(name) for name in ("scan_centre", "corrected_scale", "scan")}

    first = keys(begin(engine))
    assert keys(begin(engine)) == first
    assert keys(begin(engine).with_value(JobState.thermal_scale, 0.3)) == first, "what was not taken does not count"
    assert keys(begin(engine, part="q"))["scan_centre"] != first["scan_centre"]
    assert keys(begin(engine, part="q"))["corrected_scale"] == first["corrected_scale"] == digest(0.25), (
        "a number is its own key"
    )
    assert first["scan"] == "s", "what is handed on as it was keeps its key"


def test_what_a_step_calls_is_in_its_keys(engine: Engine, tmp_path: Path) -> None:
    @step(gives="scan_centre", calls=(Allowance,))
    def give(engine: Engine, state: JobState) -> Floats:
        return POINTS

    assert give.takes == ("part", "tolerance"), "what is the job's of what the contract takes"
    first = engine.take(give, begin(engine)).key("scan_centre")
    milling = load(tmp_path / "job.yaml", engine.registry, ["allowance.use=milling", "allowance.outer=1"])
    other = Engine(milling, engine.registry)
    assert other.take(give, begin(other)).key("scan_centre") != first


def test_a_step_sees_nothing_but_what_it_names(engine: Engine) -> None:
    @step(gives="scan_centre", reads=("scan",))
    def peek(state: JobState) -> Floats:
        return state.part.vertices

    with pytest.raises(KeyError, match="part"):
        engine.take(peek, begin(engine))


def test_warnings_are_added_unless_they_were_taken(engine: Engine) -> None:
    @step(gives="warnings")
    def add(part: Part) -> Reasons:
        return [Reason("unit", part.unit)]

    @step(gives="warnings")
    def drop(warnings: Reasons) -> Reasons:
        return warnings[1:]

    once = engine.take(add, begin(engine))
    twice = engine.take(add, once)
    assert len(twice.warnings) == 2
    assert len({state.key("warnings") for state in (begin(engine), once, twice)}) == 3
    assert len(engine.take(drop, twice).warnings) == 1


def test_what_a_kept_step_gave_is_found_again(engine: Engine) -> None:
    calls: list[int] = []

    @step(gives=("corrected_scale", "thermal_scale"), kept=True)
    def measure(scan: Scan) -> tuple[float, float]:
        calls.append(len(scan.points))
        return np.float64(1 / 3), 0.5

    first = engine.take(measure, begin(engine))
    later = Engine(engine.job, engine.registry, engine.cache).take(measure, begin(engine))
    assert calls == [4]
    assert (later.corrected_scale, later.thermal_scale) == (1 / 3, 0.5)
    assert later.keys == first.keys
    Engine(engine.job, engine.registry, engine.cache).take(measure, begin(engine, scan="another"))
    assert calls == [4, 4]


def test_a_step_is_a_function() -> None:
    scan, part = Scan(POINTS, noise=0.1, spacing=0.2), damaged_box.box()
    kept, aligned, told = place_scan(scan, Pose(np.eye(4)), part, 0.3, "mm")
    assert kept is scan
    assert not told
    assert np.array_equal(aligned.points, POINTS)
    assert (aligned.noise, aligned.spacing) == (0.1, 0.2)


def test_a_number_of_numpy_has_the_key_of_the_same_number() -> None:
    """What the cache gives back is a number of Python: the key has to be the same on the next run."""
    assert digest(np.float64(0.1)) == digest(0.1)
    assert digest(np.bool_(True), np.int64(3)) == digest(True, 3)


def test_a_step_that_gives_a_registration_gives_what_it_is_made_of(engine: Engine) -> None:
    @step(gives=("registration", "corrected_scale"))
    def shift(registration: Registration) -> tuple[Registration, float]:
        aligned = replace(registration.aligned, noise=0.5)
        return replace(registration, aligned=aligned, warnings=registration.warnings[1:]), 1.5

    state = begin(engine).with_value(JobState.aligned, Scan(POINTS, noise=0.1), "a")
    state = state.with_named("tolerance", 0.2, "t").with_value(JobState.pose, Pose(np.eye(4)), "p")
    state = state.with_value(JobState.warnings, (Reason("unit", "settled"), Reason("unit", "open")), "w")
    assert (state.noise, state.registration.aligned) == (0.1, state.aligned)
    done = engine.take(shift, state)
    assert (done.noise, done.corrected_scale) == (0.5, 1.5)
    assert [note.text for note in done.warnings] == ["open"]
    assert done.key("aligned") != state.key("aligned")
    for name in ("scan", "part", "pose", "tolerance"):
        assert done.key(name) == state.key(name), "what stays as it was keeps its key"
    assert "registration" not in done.values


def test_the_field_is_that_of_the_state_and_made_once(engine: Engine) -> None:
    seen: list[ScanField] = []

    @step(gives="scan_centre")
    def look(field: ScanField) -> Floats:
        seen.append(field)
        return field.feet

    assert look.takes == ("field",)
    state = begin(engine).with_value(JobState.aligned, Scan(POINTS), "a").with_named("tolerance", 0.2, "t")
    field = ScanField.measure(state.part, state.aligned, 0.2)
    state = state.with_value(JobState.deviation, field.deviation, "d")
    first = engine.take(look, state)
    again = engine.take(look, first)
    assert again.key("scan_centre") == first.key("scan_centre")
    assert state.field is first.field is seen[0] is seen[-1], "what follows from it is kept"
    moved = state.with_value(JobState.deviation, field.deviation, "other")
    assert moved.field is not seen[0]
    assert engine.take(look, moved).key("scan_centre") != first.key("scan_centre")
    assert set(MADE_OF["field"]) <= set(state.select(("field",)).values)
