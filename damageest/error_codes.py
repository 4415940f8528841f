"""The sorts of errors, and what a command's exit status means: for `damageest explain`, for the line below an error,
and for the tables of docs/command-line.md.

No more is imported than the errors: where memory ran out, to import numpy may never end.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from damageest.errors import DamageestError, StageError


@dataclass(frozen=True)
class ErrorCode:
    """A sort of error: its ``meaning``, the exit status, the ``remedy``, and the ``page`` of the documentation."""

    meaning: str
    status: int
    remedy: str
    page: str


ERROR_CODES: dict[str, ErrorCode] = {
    "job": ErrorCode(
        "the job file is not valid: each fault has its line and the valid choices",
        2,
        "Correct these lines; `damageest validate` checks a job and computes nothing.",
        "docs/job-reference.md",
    ),
    "option": ErrorCode(
        "an option of the command line is not valid",
        2,
        "Correct it; `--help` after the command lists its options.",
        "docs/command-line.md",
    ),
    "part_file": ErrorCode(
        "the part file cannot be read, or is no solid",
        2,
        "Export the part again as a closed solid, as STEP, STL or 3MF.",
        "docs/your-own-scan.md#what-the-part-should-be",
    ),
    "scan_file": ErrorCode(
        "the scan file cannot be read, or has no usable points",
        2,
        "Export the scan again, as PLY or E57, and compare its size with that in the scanner's software.",
        "docs/your-own-scan.md#how-to-export-from-the-scanners-software",
    ),
    "input": ErrorCode(
        "a given file, folder, array or value cannot be used",
        2,
        "Follow the message.",
        "docs/your-own-scan.md",
    ),
    "cancelled": ErrorCode(
        "the calling program cancelled the run",
        1,
        "Nothing: finished stages are kept where the run had a cache or an output folder.",
        "docs/python.md",
    ),
    "output": ErrorCode(
        "the output folder cannot be written, is used by another run, or holds other files",
        2,
        "Make room, wait for the other run, or name another folder by `--output`. An earlier result is whole.",
        "docs/faults.md#the-output-folder",
    ),
    "result_folder": ErrorCode(
        "the folder is no output folder of a run",
        2,
        "Name the folder that `damageest run` prints last, or run the job again.",
        "docs/evidence-and-limits.md",
    ),
    "plugin": ErrorCode(
        "a plugin breaks its contract, is installed twice, or lacks a dependency",
        2,
        "`damageest plugins` says which and why. Take another implementation, or report it to its authors.",
        "docs/plugin-guide.md#when-it-does-not-work",
    ),
    "missing": ErrorCode(
        "a Python package, a system library, OpenGL or a display is missing",
        1,
        "Install what the message names; `damageest doctor` lists the rest.",
        "docs/install.md",
    ),
    "stage": ErrorCode(
        "a stage failed or refused its input: the message names stage, site and reason",
        1,
        "Follow the line after `try:`.",
        "docs/stages.md",
    ),
    "memory": ErrorCode(
        "a computation needs more memory than is free",
        1,
        "Take a larger tolerance or fewer points (`scan.most_points`), or raise `--memory`. For a file that is too "
        "large to be read, the exit status is 2.",
        "docs/faults.md#memory",
    ),
    "time_limit": ErrorCode(
        "a stage exceeded its time limit",
        1,
        "Raise `--stage-timeout`, or take another implementation.",
        "docs/batch.md#limits-of-memory-and-time",
    ),
    "crash": ErrorCode(
        "the process of a stage crashed",
        1,
        "Take another implementation, and report the crash with job and inputs. An earlier result is whole.",
        "docs/batch.md#limits-of-memory-and-time",
    ),
    "faulty": ErrorCode(
        "the code of a stage failed unexpectedly, or broke its contract",
        1,
        "Take another implementation, and report it to the authors of the named package.",
        "docs/plugin-guide.md#when-it-does-not-work",
    ),
    "not_accepted": ErrorCode(
        "no site is accepted as damage",
        1,
        "Read the reasons, and accept damage in the job, for example `accept: [1]`.",
        "docs/verdicts.md",
    ),
    "unexpected": ErrorCode(
        "damageest itself failed",
        1,
        "`--debug` shows where. Report it, with the job and what `damageest doctor` prints.",
        "docs/faults.md",
    ),
}
EXIT_STATUSES: dict[int, str] = {
    0: "done; also `run` without damage found, or without an extra for the report",
    1: "a stage failed or refused, no site is accepted, a site has no volume, a job of a batch is not `ok`, a "
    "tolerance is not met (`inspect`), or `verify` or `doctor` found a fault",
    2: "the command, the job or an input is not valid; no result was written for that job",
    130: "ended by Ctrl-C",
    141: "broken pipe",
}
STAGE_PAGES = {
    "part": "docs/your-own-scan.md#what-the-part-should-be",
    "scan": "docs/your-own-scan.md",
    "align": "docs/pose-and-wear.md",
    "adapt": "docs/adaptive.md",
    "allowance": "docs/cam.md#stock-to-mill-off",
    "path": "docs/paths.md",
    "export": "docs/cam.md#files",
}
"""Pages about the work of a stage, where there is one; of others, its page in docs/stages."""


def name_code(error: BaseException) -> str:
    """The word by which `damageest explain` says more about an error: its topic, else its sort."""
    topic = str(getattr(error, "topic", ""))
    return topic or (error.code if isinstance(error, DamageestError) else "unexpected")


def find_page(error: BaseException) -> str:
    """The page of the documentation on an error, with the section where there is one."""
    if word := getattr(error, "topic", ""):
        from damageest.rules.advice import TOPICS

        for topic in TOPICS:
            if topic.word == word:
                return topic.page
    if isinstance(error, StageError) and error.code == "stage":
        own = f"docs/stages/{error.stage}.md" if error.stage else ERROR_CODES["stage"].page
        return STAGE_PAGES.get(error.stage, own)
    return ERROR_CODES[name_code(error)].page


def describe_help(error: BaseException) -> str:
    """The line below an error: the command that explains it, and the page."""
    return format_help(name_code(error), find_page(error))


def format_help(code: str, page: str = "") -> str:
    """The line that says where to read more about a code; ``page``: that of the code by default."""
    return f"help: damageest explain {code}; see {page or ERROR_CODES[code].page}"


def format_errors() -> str:
    """Markdown: the exit statuses, and the sorts of errors."""
    lines = ["| status | meaning |", "| --- | --- |"]
    lines += [f"| {status} | {meaning} |" for status, meaning in EXIT_STATUSES.items()]
    lines += [
        "",
        "## Errors",
        "",
        "| error | status | meaning | what to do | page |",
        "| --- | --- | --- | --- | --- |",
    ]
    for code, one in ERROR_CODES.items():
        link = one.page.removeprefix("docs/")
        name = re.sub(r"\.md.*", "", link)
        lines.append(f"| `{code}` | {one.status} | {one.meaning} | {one.remedy} | [{name}]({link}) |")
    return "\n".join(lines) + "\n"
