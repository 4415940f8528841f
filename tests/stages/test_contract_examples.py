"""The example in each contract's docstring is an implementation that the registry would accept."""

from __future__ import annotations

import inspect
import textwrap
from typing import Any

import pytest

from damageest.registry.contracts import DEFAULTS, Contract, contract_of
from damageest.stages import Stage


def find_example(contract: Contract) -> str:
    """The literal block after ``Example::`` in the contract's docstring, without its indentation."""
    before, mark, block = (inspect.getdoc(contract) or "").partition("Example::\n")
    assert mark, f"the docstring of {contract.__name__} has no  Example::"
    assert len(before.splitlines()) > 5, "arguments, result and errors come first"
    return textwrap.dedent(block)


@pytest.mark.parametrize("contract", DEFAULTS, ids=lambda contract: contract.__name__)
def test_the_example_is_an_implementation_of_its_contract(contract: Contract) -> None:
    code = find_example(contract)
    names: dict[str, Any] = {"__name__": __name__}
    exec(compile(code, f"<example of {contract.__name__}>", "exec"), names)  # our own docstring
    own = [each for each in names.values() if isinstance(each, type) and issubclass(each, Stage)]
    (cls,) = (each for each in own if each.__module__ == __name__)
    assert contract_of(cls) is contract
    assert cls.needs()
    assert inspect.getdoc(cls) != inspect.getdoc(contract), "the example has a docstring of its own"
    lines = code[code.index(f"class {cls.__name__}") :].splitlines()
    assert len([line for line in lines if line.strip()]) <= 20, "an example is short"
