"""By Open3D: damage surfaces by ball pivoting, and the part minus a Poisson body of the scan."""

from __future__ import annotations

from damageest import hookimpl
from damageest.stages import Stage


@hookimpl
def damageest_stages() -> list[type[Stage]]:
    """What this plugin provides. Raises PluginError where a system library that Open3D loads is not there."""
    from damageest_open3d._system import check

    check()
    from damageest_open3d.ball_pivot import BallPivot
    from damageest_open3d.poisson_subtract import PoissonSubtract

    return [BallPivot, PoissonSubtract]
