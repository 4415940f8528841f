"""Many cases with known truth, each in a process of its own: ``python -m damageest.evaluate.suite --help``.

Rows are appended to a file of JSON lines as they come; a case that has its row there is not run again.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from damageest.evaluate._case import Case, cases, run_case
from damageest.evaluate.parts import PARTS

RIGHT, WRONG = 0.95, 0.9
"""IoU from which a case is right, and below which it is wrong."""
MARK = "@row "


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the cases and prints the table and its summary; 0 whatever the scores."""
    options = _parser().parse_args(arguments)
    if options.case:
        print(MARK + json.dumps(run_case(Case(**json.loads(options.case)))), flush=True)
        return 0
    parts = options.parts.split(",") if options.parts else list(PARTS)
    if unknown := [name for name in parts if name not in PARTS]:
        sys.exit(f"no such part: {', '.join(unknown)}; there are: {', '.join(PARTS)}")
    wanted = cases(
        options.cases,
        options.seed,
        parts,
        options.pose,
        options.method,
        options.undamaged,
        options.points,
        options.tolerance,
        tuple(options.set),
    )
    rows = run_all(wanted, options.out, options.jobs, options.timeout)
    print("\n" + summary(rows, options.undamaged))
    return 0


def run_all(wanted: Sequence[Case], out: Path | None, jobs: int, timeout: float) -> list[dict[str, Any]]:
    """The rows of all cases in their order, those already in ``out`` taken from there; prints each as it comes."""
    known = {row["key"]: row for row in _read(out)}
    rows = [known[case.key()] for case in wanted if case.key() in known]
    print(HEADER)
    for row in rows:
        print(line(row))
    with ThreadPoolExecutor(jobs) as pool:
        open_cases = [case for case in wanted if case.key() not in known]
        futures = [pool.submit(_apart, case, timeout) for case in open_cases]
        for future in as_completed(futures):
            row = future.result()
            rows.append(row)
            print(line(row), flush=True)
            if out:
                with out.open("a") as stream:
                    stream.write(json.dumps(row) + "\n")
    order = {case.key(): k for k, case in enumerate(wanted)}
    return sorted(rows, key=lambda row: order[row["key"]])


def _apart(case: Case, timeout: float) -> dict[str, Any]:
    """The case's row from a process of its own; a crash or a timeout is a row with an error, not flagged."""
    command = [sys.executable, "-m", "damageest.evaluate.suite", "--case", json.dumps(asdict(case))]
    row: dict[str, Any] = {"key": case.key(), "part": case.part, "seed": case.seed, "kinds": [], "share": 0.0}
    row |= {"iou": 0.0, "flagged": False, "sites": 0, "seconds": timeout}
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False)
    except subprocess.TimeoutExpired:
        return row | {"error": f"not done after {timeout:g} s"}
    for text in done.stdout.splitlines():
        if text.startswith(MARK):
            found: dict[str, Any] = json.loads(text.removeprefix(MARK))
            return found
    said = done.stderr.strip().splitlines()
    return row | {"error": f"crashed ({done.returncode}): {said[-1] if said else ''}"}


def _read(out: Path | None) -> list[dict[str, Any]]:
    """The whole rows of a file; one cut short, as by a run that was killed, is dropped from it."""
    if out is None or not out.is_file():
        return []
    rows, lines = [], out.read_text().splitlines(keepends=True)
    for text in lines:
        with contextlib.suppress(json.JSONDecodeError):
            rows.append(json.loads(text))
    if len(rows) < len(lines):
        out.write_text("".join(json.dumps(row) + "\n" for row in rows))
    elif lines and not lines[-1].endswith("\n"):
        out.write_text("".join(lines) + "\n")
    return rows


HEADER = (
    f"{'part':12s} {'seed':>6s} {'kinds':30s} {'share':>6s} {'IoU':>6s} {'vol.err':>8s} {'surf/tol':>8s} "
    f"{'pose/sig':>8s} {'sites':>5s} {'sound':>5s} {'closed':>6s} {'method':8s} {'sec':>6s}"
)


def line(row: dict[str, Any]) -> str:
    """A row of the table."""

    def number(name: str, form: str, width: int) -> str:
        value = row.get(name)
        return ("-" if value is None else format(value, form)).rjust(width)

    text = (
        f"{row['part']:12s} {row['seed']:6d} {'+'.join(row['kinds'])[:30]:30s} {100 * row['share']:5.1f}% "
        f"{row['iou']:6.3f} {number('volume_error', '+.4f', 8)} {number('surface_error', '.3f', 8)} "
        f"{number('pose_error', '.2f', 8)} {row['sites']:5d} {'no' if row['flagged'] else 'yes':>5s} "
        f"{'yes' if row.get('watertight') else '-':>6s} {','.join(row.get('methods', []))[:8]:8s} {row['seconds']:6.1f}"
    )
    remarks = [row["error"], *row.get("failures", []), *row.get("reasons", [])]
    return text + "".join(f"\n      {remark[:200]}" for remark in remarks if remark)


def summary(rows: Sequence[dict[str, Any]], undamaged: bool = False) -> str:
    """Figures over all rows, in a few lines."""
    if not rows:
        return "no cases"
    seconds = np.array([row["seconds"] for row in rows])
    errors = sum(bool(row["error"]) for row in rows)
    if undamaged:
        clean = sum(not row["sites"] and not row["error"] for row in rows)
        return f"{len(rows)} undamaged: {clean} without a site, {errors} errors; {np.median(seconds):.1f} s median"
    iou = np.array([row["iou"] for row in rows])
    flagged = np.array([row["flagged"] for row in rows])
    wrong, good, right = iou < WRONG, iou >= WRONG, iou >= RIGHT
    surface = [row["surface_error"] for row in rows if row.get("surface_error") is not None]
    volume = [abs(row["volume_error"]) for row in rows if row.get("volume_error") is not None]
    lost = [row for row in rows if (row.get("pose_error") or 0) > 4]
    lines = [
        f"{len(rows)} cases: IoU >= {RIGHT}: {right.sum()} ({right.mean():.0%}), median {np.median(iou):.4f}, "
        f"worst {iou.min():.3f}; {errors} without a result",
        f"wrong (IoU < {WRONG}): {wrong.sum()}, flagged {(wrong & flagged).sum()} of them",
        f"falsely flagged: {(good & flagged).sum()} of {good.sum()} with IoU >= {WRONG}, "
        f"{(right & flagged).sum()} of {right.sum()} with IoU >= {RIGHT}",
        f"pose off by more than 4 sigma: {len(lost)}",
        f"seconds: median {np.median(seconds):.1f}, most {seconds.max():.1f}",
    ]
    if surface:
        lines.insert(
            1,
            f"surface error: median {np.median(surface):.3f} tolerances; "
            f"volume error: median {np.median(volume):.2%}, 90th percentile {np.quantile(volume, 0.9):.2%}",
        )
    return "\n".join(lines)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser("python -m damageest.evaluate.suite", description="accuracy against known truth")
    parser.add_argument("--cases", type=int, default=26, help="how many; they go through the parts in turn")
    parser.add_argument("--seed", type=int, default=0, help="of the damages, scans and poses")
    parser.add_argument("--parts", default="", help=f"names, comma between; default all: {','.join(PARTS)}")
    parser.add_argument("--jobs", type=int, default=2, help="cases at a time")
    parser.add_argument("--pose", choices=("random", "identity"), default="random", help="identity: pose known")
    parser.add_argument("--method", choices=("auto", "implicit", "surface", "octree"), default="auto")
    parser.add_argument("--points", type=int, default=150_000, help="points of a scan")
    parser.add_argument("--tolerance", default="4", help="multiple of the noise's standard deviation, or auto")
    parser.add_argument("--undamaged", action="store_true", help="scans without damage; right is to find no site")
    parser.add_argument("--timeout", type=float, default=300, help="seconds for a case")
    parser.add_argument("--out", type=Path, default=None, help="file of JSON lines, to go on from and to append to")
    parser.add_argument(
        "--set", action="append", default=[], metavar="STAGE.OPTION=VALUE", help="for the job; may be given repeatedly"
    )
    parser.add_argument("--case", default="", help=argparse.SUPPRESS)
    return parser


if __name__ == "__main__":
    sys.exit(main())
