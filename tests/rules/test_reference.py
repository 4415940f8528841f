"""The documentation has every reason, with the thresholds of the code."""

from __future__ import annotations

from pathlib import Path

from typer.testing import CliRunner

from damageest.cli import app
from damageest.registry import builtins
from damageest.rules.reference import format_reasons

PAGE = Path(__file__).parents[2] / "docs" / "verdicts.md"


def test_the_page_has_the_tables_of_the_rules() -> None:
    table = format_reasons(
        [rule() for rule in builtins.damageest_rules()], [term() for term in builtins.damageest_terms()]
    )
    between = PAGE.read_text().partition("<!-- reasons: begin -->\n")[2].partition("<!-- reasons: end -->")[0]
    assert between == table, "write it anew: damageest schema reasons"


def test_the_command_prints_them() -> None:
    done = CliRunner().invoke(app, ["schema", "reasons"])
    assert done.exit_code == 0
    assert "| `two_sheets` |" in done.output
