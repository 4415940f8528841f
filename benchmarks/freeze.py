"""Whether two checkouts give the same results: what each job prints, its result.json without times, and each file.

    python benchmarks/freeze.py record CHECKOUT KEPT.json [JOB ...] [--commands FILE]
    python benchmarks/freeze.py compare BEFORE.json AFTER.json

`record` runs the example jobs and the bad scans of a checkout, and further ones that are given, each as a process
without a cache; `--commands` names a file with a further command line in each line, as `evaluate suite --cases 10
--json`, of which the printed text counts. Rows that KEPT.json has are not computed again. `compare` prints what
differs and ends with exit status 1 where anything does.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

TIMES = ("seconds", "cpu_seconds", "versions", "provider", "stages", "steps", "provenance", "megabytes", "key")
"""Fields of JSON that differ from run to run or from version to version."""
PRINTED_TIMES = re.compile(r"\b\d+(?:\.\d+)? (?:s|MB)\b|[0-9a-f]{24,}")
STEP = re.compile(r"  \S.* …( |$)")
"""A line of the progress: steps that take long are named, which depends on the machine."""
LEFT_OUT = ("job.yaml", "report.html", "report.pdf", "batch.html")
"""Files that name paths, dates or times. What they show is in the others."""
Row = dict[str, Any]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="what", required=True)
    record = commands.add_parser("record")
    record.add_argument("checkout", type=Path)
    record.add_argument("kept", type=Path)
    record.add_argument("jobs", type=Path, nargs="*", help="default: all example jobs and bad scans of the checkout")
    record.add_argument("--commands", type=Path)
    compare = commands.add_parser("compare")
    compare.add_argument("before", type=Path)
    compare.add_argument("after", type=Path)
    given = parser.parse_args()
    if given.what == "compare":
        lines = compare_rows(json.loads(given.before.read_text()), json.loads(given.after.read_text()))
        print("\n".join(lines) or "nothing differs")
        return 1 if lines else 0
    checkout = given.checkout.resolve()
    jobs = [job.resolve() for job in given.jobs] or [
        job for folder in ("jobs", "jobs/bad_scans") for job in sorted((checkout / folder).glob("*.yaml"))
    ]
    lines = given.commands.read_text().splitlines() if given.commands else []
    record_rows(checkout, given.kept, jobs, [shlex.split(line) for line in lines if line.strip()])
    return 0


def record_rows(checkout: Path, kept: Path, jobs: list[Path], commands: list[list[str]]) -> None:
    """Writes the rows that ``kept`` lacks into it, each as soon as it is known."""
    rows: dict[str, Row] = json.loads(kept.read_text()) if kept.exists() else {}
    program = str(checkout / ".venv" / "bin" / "damageest")
    for job in jobs:
        name = str(job.relative_to(checkout)) if job.is_relative_to(checkout) else job.name
        if name not in rows:
            with tempfile.TemporaryDirectory(prefix="damageest-freeze-") as folder:
                out = Path(folder) / "out"
                row = run_command([program, "run", str(job), "-o", str(out), "--no-cache"], checkout, (folder, job))
                rows[name] = row | {"files": list_files(out)}
            _keep(rows, kept, name)
    for words in commands:
        name = shlex.join(words)
        if name not in rows:
            rows[name] = run_command([program, *words], checkout, (checkout,))
            _keep(rows, kept, name)


def run_command(words: list[str], folder: Path, names: tuple[Any, ...]) -> Row:
    """Exit status and printed text of a command, without times and without the ``names`` of this run's places."""
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    text = done.stdout + done.stderr
    for name in names:
        text = text.replace(str(name), "…")
    try:
        text = json.dumps(drop_times(json.loads(done.stdout)))
    except ValueError:
        text = PRINTED_TIMES.sub("…", text)
    lines = [line for line in text.splitlines() if not STEP.match(line)]
    return {"status": done.returncode, "text": lines}


def list_files(folder: Path) -> dict[str, Any]:
    """result.json without times; the SHA-256 of each other file that a run wrote, its kept stages aside."""
    found: dict[str, Any] = {}
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        name = str(path.relative_to(folder))
        if name == "result.json":
            found[name] = drop_times(json.loads(path.read_text()))
        elif path.name not in LEFT_OUT and not name.startswith("stages/"):
            found[name] = hashlib.sha256(path.read_bytes()).hexdigest()
    return found


def drop_times(value: Any) -> Any:
    """The same JSON without the fields of `TIMES`, at any depth."""
    if isinstance(value, dict):
        return {name: drop_times(one) for name, one in value.items() if name not in TIMES}
    return [drop_times(one) for one in value] if isinstance(value, list) else value


def compare_rows(before: dict[str, Row], after: dict[str, Row]) -> list[str]:
    """A line for each difference: where it is, and what was there before and after."""
    lines = [f"{name}: only {'before' if name in before else 'after'}" for name in before.keys() ^ after.keys()]
    for name in before:
        if name in after:
            lines += compare_values(name, before[name], after[name])
    return lines


def compare_values(place: str, before: Any, after: Any) -> list[str]:
    """As `compare_rows`, for the values at one ``place``."""
    if isinstance(before, dict) and isinstance(after, dict):
        names = dict.fromkeys([*before, *after])
        return [
            line for name in names for line in compare_values(f"{place} > {name}", before.get(name), after.get(name))
        ]
    if isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        pairs = zip(before, after, strict=True)
        return [line for k, (one, other) in enumerate(pairs) for line in compare_values(f"{place}[{k}]", one, other)]
    return [] if before == after else [f"{place}: {_shorten(before)} -> {_shorten(after)}"]


def _shorten(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 160 else f"{text[:157]}..."


def _keep(rows: dict[str, Row], kept: Path, name: str) -> None:
    kept.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    print(f"{name}: exit {rows[name]['status']}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
