"""The check of a finished deposit: a guarantee that is not kept is refused, with the measured value."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold

from damageest.artefacts import Solid
from damageest.errors import StageError
from damageest.geometry.solids import to_arrays
from damageest.stages.allowance._booleans import join, keep_touching, simplify_exactly
from damageest.stages.allowance._selectors import StockPlan, StockTarget
from damageest.stages.allowance._skin import take_skin
from damageest.stages.allowance._verify import DepositGeometry, check_deposit
from tests.stages.allowance.shapes import TOLERANCE, block, part_of

BITE = Manifold.cube((8, 6, 4)).translate((10, 7, 8))
"""In the middle of the block's top."""
TOP = StockTarget(facing={"direction": (0, 0, 1)}, outer=1.0)


def run_check(stock: Any, hole: Any = BITE, target: StockTarget = TOP) -> tuple[float, float, float] | None:
    """The thickness of the stock on the bite; raises StageError where it is not that of the target."""
    part = part_of(block())
    plan = StockPlan(0.0, (target,), ())
    skin = take_skin(Solid(*to_arrays(BITE)), part, plan, np.zeros(3))
    work = DepositGeometry(hole + stock, BITE, stock, block() - BITE, Manifold(), skin, None, np.zeros(3))
    return check_deposit(work, part, TOLERANCE, [])[0]


def slab(height: float, low: float = 0.0) -> Any:
    return Manifold.cube((8, 6, height - low)).translate((10, 7, 12 + low))


def test_what_is_right_passes() -> None:
    assert run_check(slab(1.05)) == pytest.approx((1.05,) * 3)


@pytest.mark.parametrize(
    ("stock", "hole", "message"),
    [
        (slab(0.9), BITE, "thickness of the stock is wrong on 100.0% of the skin, by up to 0.1"),
        (slab(1.2), BITE, "thickness of the stock is wrong on 100.0% of the skin, by up to 0.2"),
        (slab(1.05) - Manifold.cube((2, 2, 1)).translate((11, 8, 12.5)), BITE, "thickness of the stock is wrong on 8"),
        (slab(1.05), BITE - Manifold.cube((1, 1, 1)).translate((12, 9, 9)), "does not fill 0.52% of the damage volume"),
        (slab(1.05) + Manifold.cube((1, 1, 2)).translate((9.5, 8, 10)), BITE, "of the deposit lies in metal"),
        (
            slab(1.05) + Manifold.cube((6, 6, 1)).translate((18, 7, 12)),
            BITE,
            r"of the skin around the damage that must have none, for example at \(2\d\.\d*, \d+\.\d*, \d+\)",
        ),
    ],
)
def test_what_is_wrong_is_refused(stock: Any, hole: Any, message: str) -> None:
    with pytest.raises(StageError, match=message):
        run_check(stock, hole)


def test_stock_on_skin_without_target_is_refused() -> None:
    none = StockTarget(facing={"direction": (0, 0, 1)}, outer=0.0)
    assert run_check(Manifold(), target=none) is None
    with pytest.raises(StageError, match="that must have none"):
        run_check(slab(1.05), target=none)


def test_pieces_that_do_not_touch_are_dropped() -> None:
    apart = Manifold.cube((2, 2, 2)).translate((40, 0, 0))
    kept = keep_touching(slab(1.0) + apart, BITE, TOLERANCE)
    assert kept.volume() == pytest.approx(48)


def test_a_union_adds_up() -> None:
    whole = simplify_exactly(join(BITE, slab(1.0, -0.01)), 30.0)
    assert whole.volume() == pytest.approx(8 * 6 * 5)
    assert whole.num_tri() == 12
