"""A process that runs spoiled jobs one after the other. For each line of its input it prints a line of JSON with
the outcome. `tests.faults.run` starts it, and starts another one where it dies.

Each line is a mode, read or run, and a path.

Usage: python -m tests.faults.worker
"""

from __future__ import annotations

import json
import os
import resource
import sys
import time
import traceback
from pathlib import Path
from typing import Any

MEMORY = 2 << 30
"""Bytes that reading a hostile file may take at most."""
SECONDS = 60.0
"""Time limit of an isolated stage; a reader has a sixth of it."""
KEPT = "out/kept"
"""Folder of the earlier output that a whole run is to replace, or to leave as it is."""
ADDRESS_SPACE = 12 << 30
"""Bytes of addresses, so that one wrong allocation cannot take the memory of the machine."""


def _measure_peak() -> int:
    with open("/proc/self/status") as stream:
        return next(int(line.split()[1]) for line in stream if line.startswith("VmHWM")) * 1024


def try_job(path: Path, mode: str, registry: Any) -> dict[str, Any]:
    """Reads a file or the inputs of a job, or runs the whole job over an earlier output: the outcome, and the message
    of an error."""
    import damageest
    from damageest.errors import DamageestError
    from damageest.isolation import Limits
    from damageest.job import load
    from damageest.pipeline.begin import start
    from damageest.pipeline.engine import Engine, follow
    from damageest.pipeline.placing.prepare import crop_scan
    from damageest.stages.part import ReadPart
    from damageest.stages.scan import ReadScan
    from tests.faults import others

    try:
        if path.name in others.FILES:
            others.FILES[path.name][1](path, registry)
            return {"outcome": "done"}
        job = load(path, registry, ["report=none"])
        if mode == "run":
            result = damageest.run(job, output=path.parent / KEPT, registry=registry, limits=Limits(seconds=SECONDS))
            words = "; ".join(map(str, (*result.failures, *result.warnings)))
            outcome = "unexpected" if "failed unexpectedly" in words else "done"
            return {"outcome": outcome, "volume": result.damage_volume, "words": words}
        engine = Engine(job, registry, limits=Limits(seconds=SECONDS))
        state = follow((ReadPart, ReadScan), engine, start(engine))
        part, scan = state.part, crop_scan(state.scan, state.reader)
        return {"outcome": "done", "volume": part.volume, "points": len(scan.points)}
    except DamageestError as error:
        words = str(error)
        if "failed unexpectedly" in words or "gave a result that is not valid" in words or not words.strip():
            return {"outcome": "unexpected", "words": words}
        return {"outcome": "refused" if error.exit_status == 2 else "stopped", "words": words}
    except BaseException as error:
        return {"outcome": "unexpected", "words": f"{type(error).__name__}: {error}", "where": traceback.format_exc()}


def main() -> None:
    """Answers until the input ends."""
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # libraries print into the output
    os.dup2(1, 2)
    from damageest.registry import Registry

    registry = Registry.discover()
    print("ready", file=answers, flush=True)
    for line in sys.stdin:
        mode, _, path = line.strip().partition(" ")
        with open("/proc/self/clear_refs", "w") as stream:
            stream.write("5")  # begins a new peak
        start = time.perf_counter()
        row = try_job(Path(path), mode, registry)
        row["seconds"] = round(time.perf_counter() - start, 2)
        row["peak"] = _measure_peak()
        print(json.dumps(row), file=answers, flush=True)


if __name__ == "__main__":
    main()
