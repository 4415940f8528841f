"""A smooth field, only for parts that are not as designed."""

from __future__ import annotations

from typing import ClassVar, Literal

from damageest.stages.adapt.smooth import Smooth


class AutoAdapt(Smooth):
    """Like `smooth`, but tried only where intact skin shows a bent, twisted, stretched or scaled part.

    Otherwise, and where held-out patches of the scan contradict the field, the result is that of `none`, byte for byte.
    """

    use: Literal["auto"] = "auto"  # type: ignore[assignment]
    asks_first: ClassVar[bool] = True
