"""What every implementation of every stage has to keep."""

from __future__ import annotations

import copy
import pickle
import random
import typing
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, ClassVar

import numpy as np
import pytest

from damageest.artefacts import Floats
from damageest.conformance import _scene
from damageest.errors import InputError, StageError
from damageest.registry.contracts import contract_of
from damageest.stages import Stage

TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
"""A rotation about no axis of the scene."""
FAR = np.array([3e4, -2e4, 5e4])

REFUSED = (StageError, InputError)


class StageContract:
    """What every implementation has to keep.

    ``stage``: the implementation, with the options to check it with. ``lengths``: those of its options that are
    lengths or places in the job's unit, and so grow with the scene where that is scaled. ``exceptions``: names of
    checks that it need not pass, each with the reason, under which the check is skipped.
    """

    stage: ClassVar[Any]
    lengths: ClassVar[tuple[str, ...]] = ()
    exceptions: ClassVar[Mapping[str, str]] = {}

    def __init_subclass__(cls) -> None:
        cls._kept = {}

    _kept: ClassVar[dict[str, Any]] = {}

    @pytest.fixture(autouse=True)
    def _excepted(self, request: pytest.FixtureRequest) -> None:
        if reason := self.exceptions.get(request.function.__name__):
            pytest.skip(f"not promised: {reason}")

    def scene(self) -> dict[str, Any]:
        """Everything that the contract gives, by name."""
        known = vars(_scene.scene())
        return {name: known[name] for name in type(self.stage).takes() if name in known}

    def inputs(self, scale: float = 1.0, turn: Floats | None = None, shift: Floats | None = None) -> dict[str, Any]:
        """The scene scaled, turned and shifted in that order."""
        turn, shift = np.eye(3) if turn is None else turn, np.zeros(3) if shift is None else shift
        return {name: _scene.place(value, scale, turn, shift) for name, value in self.scene().items()}

    def sized(self, scale: float) -> Any:
        """The implementation, with its options for a scene scaled by ``scale``."""
        if not self.lengths or scale == 1:
            return self.stage
        options = self.stage.model_dump()
        grown = {n: (np.array(options[n]) * scale).tolist() for n in self.lengths if options[n] is not None}
        return type(self.stage).model_validate({**options, **grown})

    def run(self, **changes: Any) -> Any:
        """The result for the scene with some of its values changed."""
        return self.call(self.stage, {**self.inputs(), **changes})

    def plain(self) -> Any:
        """The result for the scene as it is, computed once."""
        return self._watched()[0]

    def _watched(self) -> tuple[Any, list[str]]:
        """The plain result, and what of the inputs the run has changed."""
        key = repr(self.stage)
        if key not in self._kept:
            given = self.inputs()
            before = self.state(given)
            result, after = self.call(self.stage, given), self.state(given)
            self._kept[key] = result, [name for name in before if before[name] != after[name]]
        kept: tuple[Any, list[str]] = self._kept[key]
        return kept

    def state(self, given: dict[str, Any]) -> dict[str, bytes]:
        """What a run has to leave as it is."""
        return {name: content(value) for name, value in given.items()}

    def call(self, stage: Any, given: dict[str, Any]) -> Any:
        return stage.run(**{name: given[name] for name in stage.needs()})

    def of(self, scale: float = 1.0, turn: Floats | None = None, shift: Floats | None = None) -> Any:
        """The result for the scene scaled, turned and shifted."""
        return self.call(self.sized(scale), self.inputs(scale, turn, shift))

    def test_declares_itself(self) -> None:
        cls = type(self.stage)
        assert isinstance(self.stage, Stage)
        assert contract_of(cls) is not None
        cls.needs()
        assert len(typing.get_args(cls.model_fields["use"].annotation)) == 1, "use: Literal['name']"
        assert vars(cls).get("__doc__"), "a docstring says when to take it"
        assert not [n for n, f in cls.model_fields.items() if n != "use" and not f.description], "describe every option"
        assert not [n for n in self.exceptions if not hasattr(self, n)], "exceptions name checks"
        assert not [n for n in self.lengths if n not in cls.model_fields], "lengths name options"

    def test_gives_its_type(self) -> None:
        expected = typing.get_type_hints(contract_of(type(self.stage)).run)["return"]  # type: ignore[union-attr]
        assert isinstance(self.plain(), tuple if typing.get_origin(expected) is tuple else expected)

    def test_same_bytes_twice(self) -> None:
        first = content(self.plain())
        np.random.seed(99)  # noqa: NPY002  # whoever draws from the global generators differs from run to run
        random.seed(99)
        assert content(self.run()) == first

    def test_leaves_its_inputs(self) -> None:
        assert not self._watched()[1]


class PlacedContract(StageContract):
    """A contract whose results follow the scene, however large it is and wherever it lies."""

    @pytest.mark.parametrize("scale", [1e-3, 1e3])
    def test_no_length_of_its_own(self, scale: float) -> None:
        self.agree(self.of(scale=scale), self.plain(), scale, np.eye(3), np.zeros(3))

    def test_moves_along(self) -> None:
        self.agree(self.of(turn=TURN, shift=FAR), self.plain(), 1.0, TURN, FAR)

    def agree(self, got: Any, plain: Any, scale: float, turn: Floats, shift: Floats) -> None:
        """Whether a result is that of the plain scene, placed."""
        raise NotImplementedError


def back(points: Floats, scale: float, turn: Floats, shift: Floats) -> Floats:
    """Points (N,3) of a placed scene where they would be in the plain one."""
    return np.asarray((points - shift) @ turn / scale)


def content(value: Any) -> bytes:
    """The bytes of an artefact's fields, of arrays, or of anything else that can be pickled."""
    if is_dataclass(value):
        held = {field.name: content(getattr(value, field.name)) for field in fields(value)}
        return pickle.dumps((type(value).__name__, held))
    if isinstance(value, np.ndarray):
        return pickle.dumps((value.shape, str(value.dtype), value.tobytes()))
    if isinstance(value, tuple | list):
        return pickle.dumps([content(item) for item in value])
    return pickle.dumps(copy.copy(value))


def right_or_refused(run: Any, right: Any) -> None:
    """Runs, and lets ``right`` look at what comes; a refusal by StageError or InputError is as good."""
    try:
        result = run()
    except REFUSED as error:
        if not str(error).strip():
            pytest.fail("a refusal says why")
        return
    right(result)
