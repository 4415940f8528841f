"""Stage `cluster`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Deviation, Scan, Sites
from damageest.stages import Stage, asked_by_name


class Cluster(Stage, ABC):
    """Groups the points labelled DAMAGE into damage sites, and leaves out noise (paper 3.3).

    Args of ``run``, in the part's frame, lengths in the job's unit:
        aligned: the scan, N points, with ``noise`` and ``spacing``.
        deviation: distance, nearest triangle and label of each scan point, as `segment` gives them.
        tolerance: the job's tolerance; damage smaller than it cannot be told from noise.

    Returns:
        ``label`` (N,) int32: the number of each point's site, from 1 to ``count`` without gaps, 0 for a point of no
        site. Only points labelled DAMAGE belong to sites. No damage: all 0 and ``count`` 0, no error. ``notes`` may say
        how many points are noise.

    Example::

        from typing import Literal
        import numpy as np
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components
        from scipy.spatial import cKDTree
        from damageest.artefacts import DAMAGE, Deviation, Scan, Sites
        from damageest.stages.cluster import Cluster

        class Connected(Cluster):
            "A site is a set of damage points with gaps of at most three spacings of the scan."
            use: Literal["connected"] = "connected"

            def run(self, aligned: Scan, deviation: Deviation, tolerance: float) -> Sites:
                damage = np.flatnonzero(deviation.label == DAMAGE)
                i, j = cKDTree(aligned.points[damage].reshape(-1, 3)).query_pairs(
                    max(tolerance, 3 * aligned.spacing), output_type="ndarray"
                ).T
                graph = coo_array((np.ones(len(i)), (i, j)), shape=(len(damage), len(damage)))
                count, site = connected_components(graph, directed=False) if len(damage) else (0, damage)
                label = np.zeros(len(aligned.points), np.int32)
                label[damage] = site + 1
                return Sites(label, int(count))
    """

    stage: ClassVar[str] = "cluster"
    gives: ClassVar[str] = "sites"

    @asked_by_name
    @abstractmethod
    def run(self, aligned: Scan, deviation: Deviation, tolerance: float) -> Sites: ...
