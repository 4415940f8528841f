"""Progress of a run, from its process to the app: a line of JSON for each event, through a pipe that the app has
opened. In a run that the app has not started, nothing is written."""

from __future__ import annotations

import json
import os
from contextlib import suppress
from typing import Any

PIPE = "DAMAGEEST_APP_EVENTS"
"""The environment variable with the number of the open pipe."""


def tell(kind: str, **values: Any) -> None:
    """Writes an event, where the app listens. A pipe that was closed is no reason to stop a run."""
    number = os.environ.get(PIPE, "")
    if number.isdigit():
        with suppress(OSError):
            os.write(int(number), (json.dumps({"kind": kind, **values}) + "\n").encode())
