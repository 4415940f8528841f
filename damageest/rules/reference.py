"""The tables of reasons in the documentation, from the rules themselves."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.rules import RULE_FAILED, Rule, Term
from damageest.rules.notes import RUN_CODES
from damageest.trust.doubts.pose import POSE_CODES


def format_reasons(rules: Iterable[Rule], terms: Iterable[Term]) -> str:
    """Markdown: the codes of reasons for verdicts, of those that align gives against a pose, and of notes of a run; and
    the terms of an interval."""
    lines = ["| code | meaning | given from | what to do |", "| --- | --- | --- | --- |"]
    lines += [f"| `{rule.code}` | {rule.meaning} | {rule.threshold} | {rule.remedy} |" for rule in rules]
    lines.append(
        f"| `{RULE_FAILED}` | a rule of a plugin failed, which the reason names | always | update the plugin |"
    )
    lines += ["", "Against the pose, by the stage align (rule `pose`):", "", "| code | meaning |", "| --- | --- |"]
    lines += [f"| `{code}` | {meaning} |" for code, meaning in POSE_CODES.items()]
    lines += ["", "Terms of an interval, the sources of its budget:", "", "| term | source | what makes it smaller |"]
    lines += ["| --- | --- | --- |", *(f"| `{term.name}` | {term.text} | {term.remedy} |" for term in terms)]
    lines += ["", "Notes of a run:", "", "| code | meaning |", "| --- | --- |"]
    lines += [f"| `{code}` | {one.meaning} |" for code, one in sorted(RUN_CODES.items(), key=lambda item: item[1].rank)]
    return "\n".join(lines) + "\n"
