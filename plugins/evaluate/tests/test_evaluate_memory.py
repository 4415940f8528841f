"""Peak memory by stage, sampled from another process."""

from __future__ import annotations

import time

import numpy as np
import pytest
from damageest_evaluate.memory import PeakMemory
from damageest_evaluate.meter import Meter


def use(megabytes: int) -> None:
    """Holds this much memory for long enough to be sampled."""
    block = np.ones(megabytes * 2**17)
    time.sleep(0.2)
    del block


def test_the_peak_of_a_stage_is_that_while_it_ran() -> None:
    with PeakMemory() as memory:
        meter = Meter(memory)
        before = meter.measure_megabytes()
        for stage, megabytes in (("align", 300), ("segment", 0)):
            meter.damageest_before_stage(stage)
            use(megabytes)
            meter.damageest_after_stage(stage)
        assert meter.stage_megabytes["align"] == pytest.approx(before + 300, abs=20)
        assert meter.stage_megabytes["segment"] == pytest.approx(before, abs=20)
        assert meter.measure_megabytes() == pytest.approx(before + 300, abs=20)
