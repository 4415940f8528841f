"""All installed implementations keep their contracts."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from damageest import conformance
from damageest.conformance import NEAR, _scene
from damageest.io.meshes import write_points, write_stl
from damageest.registry import Registry
from damageest.registry.contracts import DEFAULTS

HERE = tempfile.TemporaryDirectory(prefix="damageest-conformance-")
FOLDER = Path(HERE.name)
SPECIMEN = _scene.sample_points(_scene.make_prism(), 8000, np.random.default_rng(1))[0]
write_stl(FOLDER / "prism.stl", _scene.make_prism())
write_points(FOLDER / "prism.ply", dict(zip("xyz", SPECIMEN.T, strict=True)))
VOLUME = _scene.make_prism().volume

_POSE = conformance.AlignContract.pose
PAIRS = [[((p - _POSE[:3, 3]) @ _POSE[:3, :3]).tolist(), p.tolist()] for p in (*np.diag([8.0, 6, 4]), -np.ones(3))]

WITH: dict[str, dict[str, Any]] = {
    "part file": {"options": {"path": FOLDER / "prism.stl"}, "volume": VOLUME},
    "part reconstruct": {"options": {"path": FOLDER / "prism.ply"}, "volume": VOLUME, "error": 0.02},
    "part earlier_scan": {"options": {"path": FOLDER / "prism.ply"}, "volume": VOLUME, "error": 0.02},
    "part brep": {
        "options": {"path": Path(__file__).parents[2] / "jobs/parts/half_torus.step"},
        "volume": np.pi**2 * 28 * 10**2,
        "error": 0.003,
    },
    "scan file": {"options": {"path": FOLDER / "prism.ply"}},
    "scan simulate": {"options": {"points": 20_000}},
    "align icp": {"pose": NEAR},
    "align constrained": {"pose": NEAR, "options": {"shift": ["x", "y", "z"], "turn": ["x", "y", "z"]}},
    "align none": {"pose": np.eye(4)},
    "align points": {
        "options": {"pairs": PAIRS},
        "lengths": ("pairs",),
        "exceptions": {"test_moves_along": "the picked points stay where they are, and the part is elsewhere then"},
    },
    "allowance milling": {"options": {"outer": 0.3}, "lengths": ("outer",)},
    "path layers": {
        "options": {
            "height": 0.25,
            "width": 0.4,
            "feed": 60,
            "standoff": 1.0,
            "nozzle": {"tip_radius": 0.2, "length": 20, "body_radius": 2},
        }
    },
    "background build_volume": {
        "options": {"size": (60.0, 60.0, 60.0)},
        "lengths": ("size",),
        "exceptions": {"test_moves_along": "the printer's volume stays where it is, and the part is out of it then"},
    },
    "enclose octree": {"error": 0.06},
    "enclose poisson_subtract": {"error": 0.13},
}
"""By implementation: the ``options`` to check it with, and other attributes of its class."""


FIRST = "enclose divide"
SLOW = {
    *("align icp", "align register", "adapt auto", "adapt smooth", "part brep"),
    *("reconstruct ball_pivot", "reconstruct pymeshlab"),
    *("background bbox", "background capsule", "background cylinder"),
    *("enclose adaptive", FIRST, "enclose octree", "enclose poisson_subtract", "enclose shortest_path"),
    "enclose sweep",
}
"""Implementations of which -m slow makes all checks, and a run of its own those of `BRIEF`: the default run of the
first."""
ELSEWHERE = {"align register", "adapt auto", "enclose poisson_subtract", "part brep"}
"""Those of them that the default run leaves out here, since one run takes 2 s or more: each job runs the first,
`adapt: smooth` is what the second runs, and the plugins have tests of their own of the others."""
COMPARED = {
    *(
        "background bbox",
        "background capsule",
        "background cylinder",
        "reconstruct ball_pivot",
        "reconstruct pymeshlab",
    ),
    *("enclose octree", "enclose poisson_subtract", "enclose shortest_path", "enclose sweep"),
}
"""Those of `SLOW` that are there to compare others with: all their checks are made nightly, the brief ones slow."""
BRIEF = ("test_declares_itself", "test_gives_its_type", "test_leaves_its_inputs", "test_fits_its_inputs")


def base(contract: type) -> Any:
    """The class of a contract, which has its name without 'Read'."""
    return getattr(conformance, f"{contract.__name__.removeprefix('Read')}Contract")


def case(item: Any) -> Any:
    """The class that checks an implementation."""
    told = dict(WITH.get(f"{item.contract.stage} {item.name}", {}))
    if f"{item.contract.stage} {item.name}" in SLOW:
        full = pytest.mark.nightly if f"{item.contract.stage} {item.name}" in COMPARED else pytest.mark.slow
        told["pytestmark"] = full
    told["stage"] = item.cls(**told.pop("options", {}))
    return type(f"Test_{item.contract.stage}_{item.name}", (base(item.contract),), told)


FOUND = Registry.discover().implementations
for _item in FOUND:
    globals()[f"Test_{_item.contract.stage}_{_item.name}"] = case(_item)


@pytest.mark.variants(1)
@pytest.mark.parametrize("name", sorted(SLOW - ELSEWHERE, key=lambda name: (name != FIRST, name)))
def test_one_run_of_a_slow_one(name: str) -> None:
    if (checks := globals().get(f"Test_{name.replace(' ', '_')}")) is None:
        pytest.skip("its plugin cannot be used here")
    made = checks()
    for check in BRIEF:
        getattr(made, check)()


@pytest.mark.parametrize("contract", DEFAULTS)
def test_a_class_for_every_contract(contract: type) -> None:
    assert issubclass(base(contract), conformance.StageContract)
    assert base(contract).__name__ in conformance.__all__
    assert [item for item in FOUND if item.contract is contract]


@pytest.mark.slow
def test_its_import_is_cheap() -> None:
    heavy = {"scipy", "igl", "trimesh", "manifold3d", "pyvista", "vtk", "pymeshlab", "open3d", "cadquery"}
    code = f"import sys, damageest.conformance; print(*({heavy} & sys.modules.keys()))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not found.stdout.strip()
