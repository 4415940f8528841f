"""Peak memory by stage, sampled from another process."""

from __future__ import annotations

import sys
import time

import numpy as np
import pytest

from damageest.errors import InputError
from damageest.evaluate.memory import PeakMemory, require_psutil
from damageest.evaluate.meter import Meter


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


def test_without_psutil_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    require_psutil()
    monkeypatch.setitem(sys.modules, "psutil", None)
    with pytest.raises(InputError, match=r"pip install 'damageest\[evaluate\]'"):
        require_psutil()
