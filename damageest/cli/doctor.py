"""`damageest doctor`: says what is installed here and whether it works, as text for a report of a fault."""

from __future__ import annotations

import math
import os
import platform
import time
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from damageest.cli._json import AsJson, say_json
from damageest.cli._streams import keep_for_results, say

if TYPE_CHECKING:
    from damageest.result import Result

LIBRARIES = ("GL", "EGL", "X11", "OpenGL")
"""Shared libraries that pictures, windows and some plugins load."""
SIZE, RADIUS = (40.0, 30.0, 20.0), 6.0
"""Edges of the box of the self-test, and the radius of the half ball that is removed from it, in mm."""
ALLOWED = 0.05
"""Share by which the volume of the self-test may be wrong. Its scan is sparse."""
JOB = f"""version: 1
tolerance: 0.4
align: none
report: none
part: box.stl
scan:
  use: simulate
  points: 6000
  noise: 0.04
  damage:
    - {{tool: sphere, centre: [0, 0, {SIZE[2] / 2}], radius: {RADIUS}}}
"""


@dataclass(frozen=True)
class Findings:
    """What was found. ``packages``: name to version, ``none`` where one is not installed. ``extras``: name to the
    command that installs it, empty where it is here. ``libraries``: name to file, empty where it is not found.
    ``self_test``: what it gave. ``tried``: how many rules and formats of plugins were called on a small example.
    ``faults``: what does not work, with what to do."""

    system: str
    python: str
    cores: int
    memory_free: int
    packages: dict[str, str]
    extras: dict[str, str]
    libraries: dict[str, str]
    plugins: list[str]
    self_test: str
    tried: int
    faults: list[str]


def command(
    as_json: AsJson = False,
    quick: Annotated[bool, typer.Option("--quick", help="Leave out the self-test, which takes some seconds.")] = False,
) -> None:
    """Check the installation and the volume of a small run. Lists what is installed and what is missing; exit status 1:
    a fault."""
    with keep_for_results(as_json):
        found = examine(quick)
    if as_json:
        say_json(asdict(found))
    else:
        _print(found)
    if found.faults:
        raise typer.Exit(1)


def examine(quick: bool) -> Findings:
    """Looks at the system and the packages; without ``quick``, runs a small job too."""
    from ctypes.util import find_library

    from damageest.cli._trials import try_plugins  # it imports numpy, which --help does not need
    from damageest.errors import EXTRAS, describe_install
    from damageest.isolation.limits import measure_free_memory
    from damageest.registry import Registry

    registry = Registry.discover()
    faults = [f"{one.provider}: {one.reason}; try: {one.remedy}" for one in registry.broken]
    told, fault, result = ("left out", "", None) if quick else _test()
    count, wrong = try_plugins(registry, result, apart=True)
    names = dict.fromkeys(EXTRAS.values())
    return Findings(
        system=f"{platform.platform()}, {platform.machine()}",
        python=platform.python_version(),
        cores=len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1,
        memory_free=measure_free_memory(),
        packages=_list_packages(),
        extras={name: "" if _has(name) else describe_install(name) for name in names},
        libraries={name: find_library(name) or "" for name in LIBRARIES},
        plugins=[f"{one}" for one in registry.providers],
        self_test=told,
        tried=count,
        faults=[*faults, *([fault] if fault else []), *wrong],
    )


def _list_packages() -> dict[str, str]:
    """The packages that the core needs, with the versions that are here."""
    from importlib.metadata import PackageNotFoundError, requires, version

    found = {}
    for line in requires("damageest") or ():
        text, _, marker = line.partition(";")
        if "extra ==" in marker:
            continue
        name = "".join(mark if mark.isalnum() or mark in "-_." else " " for mark in text).split()[0]
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "none"
    return found


def _has(extra: str) -> bool:
    """Whether the modules of an extra are there. They are not loaded."""
    from importlib.util import find_spec

    from damageest.errors import EXTRAS

    return all(find_spec(module) is not None for module, name in EXTRAS.items() if name == extra)


def _test() -> tuple[str, str, Result | None]:
    """Runs a job with known truth. Gives what came of it, what is wrong with that, empty where nothing is, and the
    result."""
    from pathlib import Path
    from tempfile import TemporaryDirectory

    import trimesh

    from damageest.api import run
    from damageest.errors import DamageestError

    true = 2 / 3 * math.pi * RADIUS**3
    begin = time.perf_counter()
    with TemporaryDirectory(prefix="damageest-") as folder:
        job = Path(folder) / "self-test.yaml"
        job.write_text(JOB)
        trimesh.creation.box(SIZE).export(job.with_name("box.stl"))
        try:
            result = run(job)
        except DamageestError as error:
            return "failed", f"the self-test failed: {error}", None
    volume = result.damage_volume
    told = f"damage volume {volume:.1f} mm³, true {true:.1f} mm³, {time.perf_counter() - begin:.1f} s"
    if abs(volume / true - 1) > ALLOWED:
        return told, f"the self-test gave a wrong volume ({told}); install damageest anew, and report it", result
    return told, "", result


def _print(found: Findings) -> None:
    say(f"system: {found.system}; Python {found.python}")
    say(f"cores: {found.cores}; memory free: {found.memory_free / 1e9:.1f} GB")
    say(f"plugins: {', '.join(found.plugins)}")
    say(f"packages: {', '.join(f'{name} {version}' for name, version in found.packages.items())}")
    for name, remedy in found.extras.items():
        say(f"extra {name}: {'not installed; ' + remedy if remedy else 'installed'}")
    for name, file in found.libraries.items():
        say(f"lib{name}: {file or 'not found; only pictures, windows and some plugins need it'}")
    say(f"self-test: {found.self_test}")
    say(f"rules and formats of plugins tried: {found.tried}")
    for fault in found.faults:
        say(f"fault: {fault}")
