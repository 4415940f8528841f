"""`damageest explain`: says what a reason, an error or an exit status means and what to do about it."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Annotated, Any

import typer

from damageest.cli._json import AsJson, say_json
from damageest.cli._streams import keep_for_results, say

if TYPE_CHECKING:
    from damageest.rules import Rule
    from damageest.rules.advice import Topic

WIDTH = 100
EXIT = "exit"
"""The word for the table of exit statuses."""
REASONS_PAGE = "docs/verdicts.md#reasons"
TERMS_PAGE = "docs/uncertainty.md#what-a-result-says"


def command(
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[WORD]...",
            help="Topics, codes of reasons as in result.json, codes of errors, or exit. Default: list them.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Explain reasons, errors and exit statuses, and what to do."""
    with keep_for_results(as_json):
        entries = _collect()
    if words:
        entries = _choose(words, entries)
    if as_json:
        say_json({"entries": [_plain(one) for one in entries]})
    elif words:
        say("\n\n".join(dict.fromkeys(_describe(one) for one in entries)))
    else:
        _list(entries)


def _collect() -> list[dict[str, Any]]:
    """All that can be explained, in the order in which it is listed; each has a ``word`` and a ``kind``."""
    from damageest.error_codes import ERROR_CODES, EXIT_STATUSES
    from damageest.registry import Registry
    from damageest.rules.advice import make_topics
    from damageest.rules.notes import RUN_CODES
    from damageest.trust.doubts.pose import POSE_CODES

    registry = Registry.discover()
    rules = {rule.code: rule for rule in registry.rules}
    meanings = {**POSE_CODES, **{code: one.meaning for code, one in RUN_CODES.items()}}
    reasons = {code: _make_reason(code, rules.get(code), meanings.get(code, "")) for code in [*rules, *meanings]}
    terms = [
        {"word": term.name, "kind": "term", "meaning": term.text, "remedy": term.remedy, "page": TERMS_PAGE}
        for term in registry.terms
    ]
    errors = [
        {"word": code, "kind": "error", "meaning": one.meaning, "remedy": one.remedy, "page": one.page,
         "exit": one.status}
        for code, one in ERROR_CODES.items()
    ]  # fmt: skip
    statuses = [
        {"word": EXIT, "kind": "exit status", "meaning": meaning, "remedy": "", "exit": status,
         "page": "docs/command-line.md#exit-statuses"}
        for status, meaning in EXIT_STATUSES.items()
    ]  # fmt: skip
    return [*map(_make_topic, make_topics(rules.values())), *reasons.values(), *terms, *errors, *statuses]


def _make_topic(topic: Topic) -> dict[str, Any]:
    return {"word": topic.word, "kind": "topic", "meaning": topic.title, "remedy": topic.text, "job": topic.job,
            "codes": topic.codes, "page": topic.page}  # fmt: skip


def _make_reason(code: str, rule: Rule | None, meaning: str) -> dict[str, Any]:
    made = {"word": code, "kind": "reason", "page": REASONS_PAGE}
    if rule is None:
        return {**made, "meaning": meaning, "remedy": ""}
    return {**made, "meaning": rule.meaning, "remedy": rule.remedy, "given_from": rule.threshold}


def _choose(words: list[str], entries: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """What the words name: a code, and the topic that it belongs to. Raises JobError for a word that names nothing."""
    from damageest.errors import Fault, JobError, suggest

    valid = list(dict.fromkeys(str(one["word"]) for one in entries))
    topics = {code: one["word"] for one in entries for code in one.get("codes", ())}
    if unknown := [word for word in words if word not in valid and word not in topics]:
        text = "damageest explain without a word lists the topics and the errors, damageest schema reasons the reasons"
        raise JobError(
            [Fault(f"no topic or code '{word}'{suggest(word, valid)}; {text}") for word in unknown], "explain", "option"
        )
    chosen: list[dict[str, Any]] = []
    for word in words:
        own = [one for one in entries if one["word"] == word]
        own = [one for one in own if one["kind"] != "topic"] + [one for one in own if one["kind"] == "topic"]
        own += [one for one in entries if one["kind"] == "topic" and one["word"] == topics.get(word, "")]
        chosen += own
    return chosen


def _plain(entry: dict[str, Any]) -> dict[str, Any]:
    """An entry with all fields, also those that it has not."""
    return {"word": "", "kind": "", "meaning": "", "remedy": "", "page": "", "job": "", "codes": (), "given_from": "",
            "exit": None, **entry}  # fmt: skip


def _describe(one: dict[str, Any]) -> str:
    """An entry in words."""
    if one["kind"] == "topic":
        job = "\n\n" + textwrap.indent(one["job"], "    ") if one["job"] else ""
        return f"{one['meaning']} ({one['word']})\n\n{_wrap(one['remedy'])}{job}\n\nsee {one['page']}"
    if one["kind"] == "exit status":
        return _wrap(f"exit status {one['exit']}: {one['meaning']}")
    status = f" (error, exit status {one['exit']})" if one["kind"] == "error" else ""
    term = " (term of the interval)" if one["kind"] == "term" else ""
    lines = [f"{one['word']}{status}{term}: {one['meaning']}"]
    lines += [f"given from: {one['given_from']}"] if one.get("given_from") else []
    lines += [f"what to do: {one['remedy']}"] if one["remedy"] else []
    return "\n".join(map(_wrap, [*lines, f"see {one['page']}"]))


def _list(entries: list[dict[str, Any]]) -> None:
    """The topics and the errors. Reasons are many, and the lines of a run name their topics."""
    for one in entries:
        if one["kind"] in ("topic", "error"):
            mark = "error: " if one["kind"] == "error" else ""
            say(f"{one['word']:<14}{mark}{one['meaning']}")
    say(f"{EXIT:<14}exit statuses of commands")


def _wrap(text: str) -> str:
    return textwrap.fill(text, WIDTH, subsequent_indent="", break_on_hyphens=False)
