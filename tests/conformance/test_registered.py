"""Every implementation found here keeps its contract, and the checks catch those that do not."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pytest

from damageest.artefacts import Mesh, Part, Solid
from damageest.conformance import (
    AllowanceContract,
    BooleanContract,
    EncloseAllContract,
    EncloseContract,
    RepairContract,
    SampleContract,
)
from damageest.registry import Registry
from damageest.stages.allowance import Allowance
from damageest.stages.boolean import Boolean
from damageest.stages.boolean.manifold import Manifold
from damageest.stages.enclose import Enclose, EncloseAll
from damageest.stages.repair import Repair
from damageest.stages.sample import Sample

CLASSES: dict[Any, Any] = {
    Sample: SampleContract,
    Enclose: EncloseContract,
    EncloseAll: EncloseAllContract,
    Repair: RepairContract,
    Boolean: BooleanContract,
    Allowance: AllowanceContract,
}


WITH: dict[str, dict[str, Any]] = {
    "enclose octree": {"error": 0.06},
}


def _made(item: Any) -> Any:
    name = f"{item.contract.stage} {item.name}"
    return type(
        f"Test_{item.contract.stage}_{item.name}",
        (CLASSES[item.contract],),
        {"stage": item.cls(), **WITH.get(name, {})},
    )


for _item in Registry.discover().implementations:
    if _item.contract in CLASSES:
        globals()[f"Test_{_item.contract.stage}_{_item.name}"] = _made(_item)


class Bad(Allowance):
    """Wrong in the way that ``fault`` says."""

    use: Literal["bad"] = "bad"
    fault: str = ""

    def run(self, damage: Solid) -> Solid | None:
        if self.fault == "type":
            return 7  # type: ignore[return-value]
        if self.fault == "edits":
            damage.vertices.flags.writeable or damage.vertices.__setitem__(0, 0.0)
        grown = {"random": np.random.random(), "length": 0.1}.get(self.fault, 0.0)  # noqa: NPY002
        centre = damage.bounds.mean(axis=0)
        return Solid(damage.vertices + grown * np.sign(damage.vertices - centre), damage.faces)


@pytest.mark.parametrize(
    ("fault", "check"),
    [
        ("type", "test_gives_its_type"),
        ("edits", "test_leaves_its_inputs"),
        ("random", "test_same_bytes_twice"),
        ("", "test_declares_itself"),
    ],
)
def test_a_bad_one_is_caught(fault: str, check: str) -> None:
    case = type("Case", (AllowanceContract,), {"stage": Bad(fault=fault)})()
    with pytest.raises((AssertionError, ValueError)):
        getattr(case, check)()


def test_an_absolute_length_is_caught() -> None:
    case = type("Case", (AllowanceContract,), {"stage": Bad(fault="length")})()
    with pytest.raises(AssertionError):
        case.test_no_length_of_its_own(1e3)


def test_a_boolean_that_gives_all_is_caught() -> None:
    class Whole(Manifold):
        """Gives the solid itself."""

        def run(self, solid: Mesh, part: Part) -> Any:  # type: ignore[override]
            return solid

    case = type("Case", (BooleanContract,), {"stage": Whole()})()
    with pytest.raises(AssertionError):
        case.test_apart_gives_none()
