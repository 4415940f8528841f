"""Stage `path`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import DepositPath, Floats, Part, Solid
from damageest.stages import Stage, asked_by_name


class Path(Stage, ABC):
    """Plans the passes that build up the deposit of one site.

    Args of ``run``, in the part's frame, lengths in the job's unit:
        body: the solid to build up, watertight: the deposit of the stage `allowance`, or the damage volume (DV).
        part: the part as designed.
        left: the part without the cavities of all sites; None where nothing is left.
        built: the deposits of the sites that are built up before this one, as one solid; None for the first.
        tolerance: the job's tolerance.
        reach: the tool axes that the machine of the stage `export` reaches, (5,): a unit vector, and the least and
            largest cosine of their angle with it; None for all, or where the job names no machine.

    Returns:
        None where no path is wanted. Else a `DepositPath`, whose passes do not touch ``left`` and ``built`` with the
        nozzle. It lists unfilled places with their volumes.

    Raises:
        StageError: where no path can be planned. The site then has none.

    Example::

        from typing import Literal

        import numpy as np
        from damageest.artefacts import DepositPath, Mesh, Solid, Unreached
        from damageest.stages.path import Path

        class OneBead(Path):
            "One bead along the longest side of the box round the deposit, at its top; for a first try."
            use: Literal["one_bead"] = "one_bead"

            def run(self, body: Solid) -> DepositPath | None:
                low, high = body.bounds
                along = int(np.argmax(high - low))
                width = float(np.sort(high - low)[1])
                ends = np.tile((low + high) / 2, (2, 1))
                ends[:, along], ends[:, 2] = (low[along], high[along]), high[2]
                up, one = np.tile([0.0, 0.0, 1.0], (2, 1)), np.ones(2, int)
                height = float(high[2] - low[2])
                return DepositPath(
                    ends, up, up, np.full(2, 60 * width), np.array([False, True]), one, one, one,
                    directions=up[:1], heights=np.array([height]), width=width, section=np.array([width * height]),
                    standoff=width, deposit_volume=body.volume, nozzle=Mesh(np.empty((0, 3)), np.empty((0, 3), int)),
                    clearance=0.0, travel_clearance=0.0,
                    unreached=(Unreached(body.volume, "the nozzle was not checked"),),
                )
    """

    stage: ClassVar[str] = "path"
    gives: ClassVar[str] = "path"
    plans_paths: ClassVar[bool] = True
    """Whether it gives paths at all."""
    per_site: ClassVar[bool] = True

    @asked_by_name
    @abstractmethod
    def run(
        self,
        body: Solid,
        part: Part,
        left: Solid | None,
        built: Solid | None,
        tolerance: float,
        reach: Floats | None,
    ) -> DepositPath | None: ...

    def list_channels(self) -> tuple[str, ...]:
        """The names of the channels of the process that its paths have, as far as the options say; see
        `DepositPath.channels`."""
        return ()

    def rank_site(self, number: int) -> int:
        """The place of a site, by its number, in the order in which the sites are built up; those of one rank follow
        each other by their numbers."""
        return 0
