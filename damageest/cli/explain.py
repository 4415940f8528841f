"""`damageest explain`: says what a reason means and what to do about it."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Annotated

import typer

from damageest.cli._streams import say

if TYPE_CHECKING:
    from damageest.rules import Rule
    from damageest.rules.advice import Topic

WIDTH = 100


def command(
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[WORD]...", help="Topics, or codes of reasons as in result.json. Default: list the topics."
        ),
    ] = None,
) -> None:
    """Say what a reason or a refusal of a run means, and what to do about it."""
    from damageest.errors import Fault, JobError, suggest
    from damageest.registry import Registry
    from damageest.rules.advice import TOPICS, find_topic
    from damageest.rules.notes import RUN_CODES
    from damageest.rules.pose import POSE_CODES

    if not words:
        for one in TOPICS:
            say(f"{one.word:<14}{one.title}")
        return
    rules = {rule.code: rule for rule in Registry.discover().rules}
    meanings = {**POSE_CODES, **{code: one.meaning for code, one in RUN_CODES.items()}}
    valid = [*(one.word for one in TOPICS), *rules, *meanings]
    if unknown := [word for word in words if word not in valid and not find_topic(word)]:
        text = "damageest schema reasons lists the codes, and damageest explain without a word the topics"
        raise JobError(
            [Fault(f"no topic or code '{word}'{suggest(word, valid)}; {text}") for word in unknown], "explain"
        )
    shown: list[str] = []
    for word in words:
        topic = find_topic(word)
        if topic is None or word != topic.word or word in rules:
            shown.append(_describe_code(word, rules.get(word), meanings.get(word, "")))
        if topic is not None:
            shown.append(_describe_topic(topic))
    say("\n\n".join(dict.fromkeys(part for part in shown if part)))


def _describe_code(code: str, rule: Rule | None, meaning: str) -> str:
    """What a code means; empty where that is not listed."""
    if rule is not None:
        lines = [f"{code}: {rule.meaning}", f"given from: {rule.threshold}"]
        return "\n".join(map(_wrap, [*lines, *([f"what to do: {rule.remedy}"] if rule.remedy else [])]))
    return _wrap(f"{code}: {meaning}") if meaning else ""


def _describe_topic(topic: Topic) -> str:
    job = "\n\n" + textwrap.indent(topic.job, "    ") if topic.job else ""
    return f"{topic.title} ({topic.word})\n\n{_wrap(topic.text)}{job}"


def _wrap(text: str) -> str:
    return textwrap.fill(text, WIDTH, subsequent_indent="", break_on_hyphens=False)
