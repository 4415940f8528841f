"""An implementation is compared with its contract when it is listed: names, types of parameters, type of the result."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np
import pytest

from damageest.artefacts import Deposit, Enclosures, Floats, Mesh, Part, Scan, Solid
from damageest.errors import PluginError
from damageest.registry import Registry
from damageest.registry.contracts import DEFAULTS
from damageest.stages.allowance import Allowance
from damageest.stages.enclose import EncloseAll
from damageest.stages.part import ReadPart
from damageest.stages.reconstruct import Reconstruct


class Base(Allowance):
    use: Literal["test"] = "test"


class Same(Base):
    def run(self, damage: Solid, tolerance: float) -> Solid | None:
        return None


class Wider(Base):
    """Accepts more than it gets, and gives less than it may."""

    def run(self, damage: Mesh, tolerance: object, others: Any) -> Deposit:
        return Deposit(damage.vertices, damage.faces)


class Untyped(Base):
    def run(self, damage, tolerance):  # type: ignore[no-untyped-def]
        return None


@pytest.mark.parametrize("cls", [Same, Wider, Untyped])
def test_types_that_fit(cls: type[Allowance]) -> None:
    assert cls.needs()[0] == "damage"


class WrongParameter(Base):
    def run(self, damage: str) -> Solid | None:
        return None


class Narrower(Base):
    """The contract may give None."""

    def run(self, damage: Solid, others: Solid) -> Solid | None:
        return None


class WrongResult(Base):
    def run(self, damage: Solid) -> int:  # type: ignore[override]
        return 0


class WiderResult(Base):
    def run(self, damage: Solid) -> Mesh | None:  # type: ignore[override]
        return None


class WrongArray(Reconstruct):
    use: Literal["test"] = "test"

    def run(self, points: np.ndarray[tuple[int], np.dtype[np.int8]]) -> Any:
        return None


class TooNarrowTolerance(ReadPart):
    """Before the scan is measured there may be no tolerance."""

    use: Literal["test"] = "test"

    def run(self, unit: str, tolerance: float) -> Part:
        raise NotImplementedError


@pytest.mark.parametrize(
    ("cls", "texts"),
    [
        (WrongParameter, ["damage: str", "gives damage: Solid"]),
        (Narrower, ["others: Solid;", "others: damageest.artefacts.Solid | None"]),
        (WrongResult, ["returns int", "Solid | None"]),
        (WiderResult, ["returns damageest.artefacts.Mesh | None", "Solid | None"]),
        (WrongArray, ["points: ", "gives points: Floats"]),
        (TooNarrowTolerance, ["tolerance: float;", "gives tolerance: float | None"]),
    ],
)
def test_types_that_do_not_fit_are_refused_with_both(cls: type[Allowance], texts: list[str]) -> None:
    with pytest.raises(PluginError) as caught:
        cls.needs()
    assert all(text in str(caught.value) for text in (cls.__qualname__, *texts)), str(caught.value)


def test_contracts_have_real_signatures() -> None:
    for contract in DEFAULTS:
        assert contract.takes(), contract
        assert "return" not in contract.takes()
        assert contract.gives_type() is not None


def test_methods_are_those_of_the_implementations(registry: Registry) -> None:
    assert registry.methods()[:4] == ("auto", "both", "surface", "implicit")
    own = {item.method for item in registry.of("enclose") if item.contract is EncloseAll}
    assert set(registry.methods(EncloseAll)) == own
    for method in own:
        name = registry.usual(EncloseAll, method)
        assert registry.get("enclose", name).method == method


class Own(EncloseAll):
    """An implementation with a method of its own."""

    method: ClassVar[str] = "own"
    use: Literal["own"] = "own"

    def run(self, part: Part, aligned: Scan) -> Enclosures:
        return Enclosures(())


def test_other_names_are_not_changed_by_the_subset() -> None:
    takes: Mapping[str, Any] = Own.takes()
    assert Own.needs() == ("part", "aligned")
    assert set(takes) > {"part", "aligned", "deviation"}
    assert takes["tolerance"] is float
    assert Reconstruct.takes()["points"] == Floats
