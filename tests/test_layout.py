"""The structure of the package, where import contracts do not reach: underscores, and what lies at the top."""

from __future__ import annotations

import ast
import re
from collections import Counter
from pathlib import Path

import pytest

from tests.sources import ROOT, SOURCES, list_imported


def find_package(path: Path) -> str:
    """The package that a source file lies in, in full."""
    parts = path.parent.parts
    first = max(k for k, part in enumerate(parts) if part == "damageest" or part.startswith("damageest_"))
    return ".".join(parts[first:])


def is_foreign(name: str, own: str) -> bool:
    """Whether a name of damageest or of a plugin is private to a room, of which ``own`` is neither the package nor a
    room inside."""
    parts = name.split(".")
    hidden = next((k for k, part in enumerate(parts) if part.startswith("_") and not part.endswith("__")), None)
    return (
        name.startswith("damageest")
        and hidden is not None
        and not f"{own}.".startswith(".".join([*parts[:hidden], ""]))
    )


def test_no_room_imports_another_rooms_underscore() -> None:
    assert len(SOURCES) > 500
    offenders = [
        f"{path.relative_to(ROOT)}: {name} is private to its room"
        for path in SOURCES
        for name in list_imported(path)
        if is_foreign(name, find_package(path))
    ]
    assert not offenders, "\n".join(offenders)


def test_a_foreign_underscore_is_found() -> None:
    assert is_foreign("damageest.stages.enclose._sew.build", "damageest.stages.align")
    assert is_foreign("damageest.geometry.solids._mend", "damageest.pipeline")
    assert is_foreign("damageest.stages.align.symmetry._turns", "damageest.stages.align")
    assert is_foreign("damageest.stages.align.symmetry._turns", "damageest.stages.align.sym")
    assert not is_foreign("damageest.stages.enclose._sew.build", "damageest.stages.enclose")
    assert not is_foreign("damageest.stages.align._whole.build", "damageest.stages.align.symmetry")
    assert not is_foreign("damageest.__version__", "damageest.cli")


MOST_FILES = 19
"""Of one room, besides its `__init__.py`: so many are seen at once."""
ONE_EACH = {"damageest/cli", "damageest/trust/doubts", "damageest/trust/terms"}
"""Rooms with one file a command, a doubt, a term."""
CROWDED = {
    "damageest/geometry": 68,
    "damageest/io": 20,
}
"""Rooms with more, and how many: public names of others, or what nobody has divided yet. None may come to be here."""


def test_a_room_is_seen_at_once() -> None:
    files = Counter(path.parent.relative_to(ROOT).as_posix() for path in SOURCES if path.name != "__init__.py")
    large = {room: count for room, count in files.items() if count > MOST_FILES and room not in ONE_EACH}
    assert {room: count for room, count in large.items() if count > CROWDED.get(room, 0)} == {}
    assert set(CROWDED) <= set(large), "no longer crowded: take it off the list"


def test_few_modules_lie_at_the_top() -> None:
    top = {path.name for path in (ROOT / "damageest").glob("*.py")}
    assert top == {
        "__init__.py", "__main__.py", "api.py", "error_codes.py", "errors.py", "findings.py", "intervals.py",
        "options.py", "result.py", "site.py",
    }  # fmt: skip


def test_the_core_names_no_module_of_a_plugin() -> None:
    """Plugins come in through hooks; messages name packages, of which `registry/bundled.py` is the list."""
    modules = [path.name for path in (ROOT / "plugins").glob("*/damageest_*")]
    assert len(modules) == len(list((ROOT / "plugins").glob("*/pyproject.toml")))
    sources = {path: path.read_text() for path in (ROOT / "damageest").rglob("*.py")}
    assert not [(path.name, name) for path, text in sources.items() for name in modules if name in text]


def test_the_package_is_typed() -> None:
    assert (ROOT / "damageest" / "py.typed").is_file()


def test_architecture_names_each_folder() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text()
    folders = {path.parent.relative_to(ROOT).as_posix() for path in (ROOT / "damageest").glob("*/__init__.py")}
    assert not [folder for folder in folders if f"{folder.split('/')[1]}/" not in text]


MOST_PARAMETERS = 8
THIRD_PARTIES = {
    "damageest/api.py run",
    "damageest/geometry/make_part.py make_part",
    "damageest/io/scans.py make_scan",
    "damageest/isolation/worker.py call_isolated",
}
"""Public functions whose keywords are in the code of others."""
LEFT = {
    "damageest/stages/align/symmetry/choose.py _is_continuous",
    "damageest/stages/align/datum/_fit.py _describe",
    "damageest/stages/align/_fit_start.py fit_from_start",
}
"""Functions that still have more. None may come to be here."""
HEADER = re.compile(
    r"^([ \t]*(?:@.*\n[ \t]*)*)(?:async )?def (\w+)(\((?:[^()]|\((?:[^()]|\([^()]*\))*\))*\))", re.MULTILINE
)
"""Decorators, name and parameters of a function: whole files need not be parsed, which takes seconds for all."""


def find_crowded(path: Path) -> set[str]:
    """The functions of a file that take too many values, but for compiled loops and commands of the command line."""
    own = path.relative_to(ROOT)
    crowded = set()
    for decorators, name, parameters in HEADER.findall(path.read_text(encoding="utf-8")):
        if parameters.count(",") < MOST_PARAMETERS or "@compile_loops" in decorators:
            continue
        if name.endswith("command") and ("cli" in own.parts or "commands" in own.parts):
            continue
        (function,) = ast.parse(f"def {name}{parameters}: ...").body
        assert isinstance(function, ast.FunctionDef)
        taken = function.args
        each = [*taken.posonlyargs, *taken.args, *taken.kwonlyargs, *filter(None, (taken.vararg, taken.kwarg))]
        if sum(one.arg not in ("self", "cls") for one in each) > MOST_PARAMETERS:
            crowded.add(f"{own.as_posix()} {name}")
    return crowded


def test_functions_take_few_values() -> None:
    """What belongs together is a value of its own: a field, a loss, a target."""
    crowded = set().union(*map(find_crowded, SOURCES))
    assert crowded == THIRD_PARTIES | LEFT


ROOMS = sorted(
    path.parent.relative_to(ROOT / "damageest").as_posix()
    for folder in ("trust", "pipeline", "stages/align")
    for path in (ROOT / "damageest" / folder).glob("*/__init__.py")
    if path.parent.relative_to(ROOT).as_posix() not in ONE_EACH
)
LISTED = ("artefacts", "batches", "trust", "inspection", "io", "isolation", "job", "registry", *ROOMS)
"""Folders whose ``__init__.py`` names every module, so that a reader who looks for one finds it."""


@pytest.mark.parametrize("folder", LISTED)
def test_a_folder_lists_its_modules(folder: str) -> None:
    place = ROOT / "damageest" / folder
    text = (place / "__init__.py").read_text()
    modules = [path.stem for path in place.glob("*.py") if path.name != "__init__.py"]
    assert not [name for name in modules if not re.search(rf"\b{name}(\.py\b| import)", text)]


def test_architecture_is_short() -> None:
    lines = (ROOT / "ARCHITECTURE.md").read_text().splitlines()
    assert len(lines) <= 100
    assert max(map(len, lines)) <= 160


def test_architecture_names_no_module_that_is_not_there() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text()
    there = {
        path.name
        for folder in ("damageest", "plugins", "benchmarks", "tests")
        for path in (ROOT / folder).rglob("*.py")
    }
    named = {Path(name).name for name in re.findall(r"`([\w/]+\.py)`", text)}
    assert named
    assert not named - there


def test_a_question_is_answered_in_two_steps() -> None:
    """ARCHITECTURE.md names the room, and the room's `__init__.py` its files or its contract."""
    text = (ROOT / "ARCHITECTURE.md").read_text()
    (answers,) = re.findall(r"^Where is it\?.*?(?=\n\n)", text, re.MULTILINE | re.DOTALL)
    named = re.findall(r"`((?:\w+/)+)`", answers)
    assert len(named) >= 9
    for room in named:
        place = next(base / room for base in (ROOT / "damageest", ROOT) if (base / room).is_dir())
        assert len((place / "__init__.py").read_text().splitlines()) > 3
