"""The checks for the implementations of all stages."""

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

from damageest.artefacts import ArtefactError, Floats
from damageest.conformance import _scene
from damageest.errors import InputError, StageError
from damageest.isolation import call_isolated
from damageest.registry.contracts import contract_of
from damageest.registry.outputs import check_output
from damageest.stages import Stage

TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
"""A rotation about an axis that is not an axis of the scene."""
FAR = np.array([3e4, -2e4, 5e4])
"""A shift that is large compared with the scene."""

REFUSED = (StageError, InputError)
"""The errors by which an implementation may refuse an input."""


class StageContract:
    """The checks for the implementations of all stages.

    ``stage``: the implementation, with its options. ``lengths``: the names of its options that are lengths or positions
    in the job's unit; they are scaled together with the scene. ``exceptions``: names of checks to skip, each with the
    reason.
    """

    stage: ClassVar[Any]
    lengths: ClassVar[tuple[str, ...]] = ()
    exceptions: ClassVar[Mapping[str, str]] = {}

    def __init_subclass__(cls) -> None:
        cls._results = {}

    _results: ClassVar[dict[str, Any]] = {}

    @pytest.fixture(autouse=True)
    def _skip_exceptions(self, request: pytest.FixtureRequest) -> None:
        if reason := self.exceptions.get(request.function.__name__):
            pytest.skip(f"exception: {reason}")

    def make_scene(self) -> dict[str, Any]:
        """All inputs of the stage that the contract provides, by name."""
        artefacts = vars(_scene.make_scene())
        return {name: artefacts[name] for name in type(self.stage).takes() if name in artefacts}

    def make_inputs(
        self, scale: float = 1.0, turn: Floats | None = None, shift: Floats | None = None
    ) -> dict[str, Any]:
        """The inputs, scaled, then turned by ``turn`` (3,3), then shifted by ``shift`` (3,)."""
        turn, shift = np.eye(3) if turn is None else turn, np.zeros(3) if shift is None else shift
        return {name: _scene.transform(value, scale, turn, shift) for name, value in self.make_scene().items()}

    def scale_stage(self, scale: float) -> Any:
        """The implementation, with the options in ``lengths`` multiplied by ``scale``."""
        if not self.lengths or scale == 1:
            return self.stage
        options = self.stage.model_dump()
        grown = {n: (np.array(options[n]) * scale).tolist() for n in self.lengths if options[n] is not None}
        return type(self.stage).model_validate({**options, **grown})

    def run(self, **changes: Any) -> Any:
        """The result with some inputs replaced by ``changes``, checked as a run of a job checks it."""
        given = {**self.make_inputs(), **changes}
        result = self.call(self.stage, given)
        self.check_fits(result, given)
        return result

    def check_fits(self, result: Any, given: dict[str, Any]) -> None:
        """Asserts that the result fits its inputs in lengths, ranges and indices; a job would be refused with it."""
        contract = contract_of(type(self.stage))
        assert contract is not None
        try:
            check_output(contract, result, {**given, "folder": getattr(self, "folder", None)}.__getitem__)
        except ArtefactError as error:
            raise AssertionError(f"a job refuses this result: {error}") from error

    def get_result(self) -> Any:
        """The result for the unchanged scene. It is computed once."""
        return self._run_and_watch()[0]

    def _run_and_watch(self) -> tuple[Any, list[str]]:
        """The result for the unchanged scene, and the names of the inputs that the run has modified."""
        key = repr(self.stage)
        if key not in self._results:
            given = self.make_inputs()
            before = self.capture_state(given)
            result, after = self.call(self.stage, given), self.capture_state(given)
            self._results[key] = result, name_changes(before, after)
        result_and_changes: tuple[Any, list[str]] = self._results[key]
        return result_and_changes

    def run_again(self) -> Any:
        """The result of a second run for the unchanged scene."""
        np.random.seed(99)  # noqa: NPY002  # a result that uses the global random generators changes now
        random.seed(99)
        return self.run()

    def capture_state(self, given: dict[str, Any]) -> dict[str, bytes]:
        """The bytes of everything that a run must not modify, by name."""
        return {name: to_bytes(value) for name, value in given.items()}

    def call(self, stage: Any, given: dict[str, Any]) -> Any:
        """Runs an implementation with those of the inputs ``given`` that it needs."""
        return stage.run(**{name: given[name] for name in stage.needs()})

    def run_placed(self, scale: float = 1.0, turn: Floats | None = None, shift: Floats | None = None) -> Any:
        """The result for the scaled, turned and shifted scene."""
        return self.call(self.scale_stage(scale), self.make_inputs(scale, turn, shift))

    def test_declares_itself(self) -> None:
        cls = type(self.stage)
        assert isinstance(self.stage, Stage)
        assert contract_of(cls) is not None
        cls.needs()
        assert len(typing.get_args(cls.model_fields["use"].annotation)) == 1, "use: Literal['name'] = 'name'"
        assert vars(cls).get("__doc__"), "the class needs a docstring that says when to use it"
        assert not [n for n, f in cls.model_fields.items() if n != "use" and not f.description], (
            "every option needs a description"
        )
        assert not [n for n in self.exceptions if not hasattr(self, n)], "exceptions must name checks"
        assert not [n for n in self.lengths if n not in cls.model_fields], "lengths must name options"

    def test_gives_its_type(self) -> None:
        expected = typing.get_type_hints(contract_of(type(self.stage)).run)["return"]  # type: ignore[union-attr]
        assert isinstance(self.get_result(), tuple if typing.get_origin(expected) is tuple else expected)

    def test_fits_its_inputs(self) -> None:
        self.check_fits(self.get_result(), self.make_inputs())

    def test_same_bytes_twice(self) -> None:
        changed = name_changes(to_named_bytes(self.get_result()), to_named_bytes(self.run_again()))
        assert not changed, "the second run gave other bytes here"

    def test_runs_in_a_process_of_its_own(self) -> None:
        """As the engine runs it, where its class says ``isolated``: code, options, inputs and result are pickled."""
        if not type(self.stage).isolated:
            pytest.skip("it runs in the engine's process")
        given = self.make_inputs()
        named = {name: given[name] for name in self.stage.needs()}
        result = call_isolated(self.stage.run, named, worker="conformance", stays=False)
        changed = name_changes(to_named_bytes(self.get_result()), to_named_bytes(result))
        assert not changed, "in a process of its own it gave other bytes here"

    def test_leaves_its_inputs(self) -> None:
        changed = self._run_and_watch()[1]
        assert not changed, "the run has changed these inputs"


class PlacementContract(StageContract):
    """A contract whose results scale and move with the scene."""

    @pytest.mark.parametrize("scale", [1e-3, 1e3])
    def test_no_length_of_its_own(self, scale: float) -> None:
        self.check_agrees(self.run_placed(scale=scale), self.get_result(), scale, np.eye(3), np.zeros(3))

    def test_moves_along(self) -> None:
        self.check_agrees(self.run_placed(turn=TURN, shift=FAR), self.get_result(), 1.0, TURN, FAR)

    def check_agrees(self, got: Any, expected: Any, scale: float, turn: Floats, shift: Floats) -> None:
        """Asserts that ``got`` is ``expected``, scaled, turned and shifted."""
        raise NotImplementedError


def undo_placement(points: Floats, scale: float, turn: Floats, shift: Floats) -> Floats:
    """Points (N,3) of a scaled, turned and shifted scene, moved back to the unchanged scene."""
    return np.asarray((points - shift) @ turn / scale)


def to_bytes(value: Any) -> bytes:
    """The bytes of an artefact's fields, of an array, or of any other object that can be pickled."""
    if is_dataclass(value):
        values = {field.name: to_bytes(getattr(value, field.name)) for field in fields(value)}
        return pickle.dumps((type(value).__name__, values))
    if isinstance(value, np.ndarray):
        return pickle.dumps((value.shape, str(value.dtype), value.tobytes()))
    if isinstance(value, tuple | list):
        return pickle.dumps([to_bytes(item) for item in value])
    return pickle.dumps(copy.copy(value))


def to_named_bytes(value: Any) -> dict[str, bytes]:
    """The bytes of each field of an artefact, each item of a tuple, or of another object as a whole, by name."""
    if is_dataclass(value):
        return {field.name: to_bytes(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, tuple | list):
        return {f"item {k}": to_bytes(item) for k, item in enumerate(value)}
    return {"result": to_bytes(value)}


def name_changes(before: Mapping[str, bytes], after: Mapping[str, bytes]) -> list[str]:
    """The names whose bytes differ, and those that only one of the two has.

    Checks assert on this list and not on the bytes: where ``CI`` is set, pytest explains a failed comparison in full,
    and for an artefact's bytes that takes hours.
    """
    return sorted(name for name in {*before, *after} if before.get(name) != after.get(name))


def check_or_refused(run: Any, check: Any) -> None:
    """Calls ``run`` and passes its result to ``check``. A refusal by StageError or InputError also passes."""
    try:
        result = run()
    except REFUSED as error:
        if not str(error).strip():
            pytest.fail("a refusal needs a message")
        return
    check(result)
