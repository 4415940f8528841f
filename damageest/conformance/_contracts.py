"""The checks, on a block of 4 x 3 x 2 with known volume."""

from __future__ import annotations

import pickle
import random
import typing
from typing import Any, ClassVar

import numpy as np
import pytest

from damageest.artefacts import Floats, Mesh, Part, Samples, Solid
from damageest.contracts import contract_of
from damageest.errors import InputError, StageError
from damageest.stages import Stage

SIZE = (4.0, 3.0, 2.0)
TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
"""A rotation about no axis of the scene."""
FAR = np.array([3e4, -2e4, 5e4])


def block(low: tuple[float, ...], high: tuple[float, ...]) -> tuple[Floats, Any]:
    """Vertices (8,3) and faces (12,3) of a box."""
    corner = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return np.array(low) + corner * (np.array(high) - np.array(low)), np.array(faces)


class Contract:
    """What every implementation has to keep. ``stage``: the implementation, with the options to check it with."""

    stage: ClassVar[Any]
    tolerance: ClassVar[float] = 0.1

    def inputs(self, scale: float = 1.0, turn: Floats | None = None, shift: Floats | None = None) -> dict[str, Any]:
        """Everything that the contract gives, for the scene scaled, turned and shifted in that order."""
        turn, shift = np.eye(3) if turn is None else turn, np.zeros(3) if shift is None else shift
        part = block((0, 0, 0), SIZE)
        bite = block((3, 1, 1), (5, 2, 3))

        def put(kind: type[Mesh], shape: tuple[Floats, Any]) -> Mesh:
            return kind(scale * shape[0] @ turn.T + shift, shape[1])

        inside = block((3, 1, 1), (4, 2, 2))
        return {
            "part": put(Part, part),
            "solid": put(Solid, bite),
            "damage": put(Solid, inside),
            "enclosure": put(Mesh, bite),
            "tolerance": scale * self.tolerance,
        }

    def run(self, **changes: Any) -> Any:
        given = {**self.inputs(), **changes}
        return self.stage.run(**{name: given[name] for name in self.stage.needs()})

    def of(self, **placed: Any) -> Any:
        return self.run(**self.inputs(**placed))

    def points(self, output: Any) -> Floats:
        """The result's points (N,3), as one by one comparable as its kind allows."""
        return output.points if isinstance(output, Samples) else output.vertices

    def test_declares_itself(self) -> None:
        cls = type(self.stage)
        assert isinstance(self.stage, Stage)
        assert contract_of(cls) is not None
        cls.needs()
        assert len(typing.get_args(cls.model_fields["use"].annotation)) == 1, "use: Literal['name']"
        assert vars(cls).get("__doc__"), "a docstring says when to take it"
        assert not [n for n, f in cls.model_fields.items() if n != "use" and not f.description], "describe every option"

    def test_gives_its_type(self) -> None:
        expected = typing.get_type_hints(contract_of(type(self.stage)).run)["return"]  # type: ignore[union-attr]
        assert isinstance(self.run(), expected)

    def test_same_bytes_twice(self) -> None:
        got = []
        for seed in (1, 99):  # two states of the global generators, neither left over from another test
            np.random.seed(seed)  # noqa: NPY002
            random.seed(seed)
            got.append(pickle.dumps(self.run()))
        assert got[0] == got[1]

    def test_leaves_its_inputs(self) -> None:
        given = self.inputs()
        before = {n: (v.vertices.tobytes(), v.faces.tobytes()) for n, v in given.items() if isinstance(v, Mesh)}
        self.run(**given)
        assert before == {n: (given[n].vertices.tobytes(), given[n].faces.tobytes()) for n in before}

    @pytest.mark.parametrize("scale", [1e-3, 1e3])
    def test_no_length_of_its_own(self, scale: float) -> None:
        self.agree(self.of(scale=scale), self.run(), scale, np.eye(3), np.zeros(3))

    def test_moves_along(self) -> None:
        self.agree(self.of(turn=TURN, shift=FAR), self.run(), 1.0, TURN, FAR)

    def agree(self, got: Any, plain: Any, scale: float, turn: Floats, shift: Floats) -> None:
        """Whether a result is that of the plain scene, placed: by its extent along the scene's own axes."""
        if plain is None or got is None:
            assert got is plain
            return
        back = (self.points(got) - shift) @ turn / scale
        want = self.points(plain)
        assert np.allclose([back.min(0), back.max(0)], [want.min(0), want.max(0)], atol=1e-6)
        if isinstance(plain, Solid):
            assert got.volume / scale**3 == pytest.approx(plain.volume, rel=1e-6)


class SampleContract(Contract):
    """Checks for `sample`."""

    def test_lies_on_the_part(self) -> None:
        points = self.run().points
        assert np.abs(np.minimum(points, np.array(SIZE) - points).min(axis=1)).max() < 1e-9


class RepairContract(Contract):
    """Checks for `repair`."""

    def test_an_empty_mesh_is_refused(self) -> None:
        with pytest.raises((StageError, InputError)):
            self.run(enclosure=Mesh(np.zeros((0, 3)), np.zeros((0, 3), int)))

    def test_what_is_closed_keeps_its_volume(self) -> None:
        assert self.run().volume == pytest.approx(4)


class BooleanContract(Contract):
    """Checks for `boolean`."""

    def test_gives_what_lies_in_the_part(self) -> None:
        assert self.run().volume == pytest.approx(1)

    def test_apart_gives_none(self) -> None:
        assert self.run(solid=Solid(*block((9, 9, 9), (10, 10, 10)))) is None


class AllowanceContract(Contract):
    """Checks for `allowance`."""

    def test_deposit_holds_the_damage(self) -> None:
        deposit = self.run()
        assert deposit is None or deposit.volume >= self.inputs()["damage"].volume
