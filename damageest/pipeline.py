"""The routes. A route is a tuple of contracts, which call the job's implementation, and of joints between them.

A lane is the state of one line of work: the whole job at first, then one site each, then the whole job again. A
contract is called once on each lane; a joint takes all lanes and gives the next ones, and may call contracts itself.
"""

from __future__ import annotations

from damageest.engine import Route
from damageest.joints import damaged, each_cluster, each_enclosure, either, gather, measured, numbered, placed, settled
from damageest.material import allowed, apart
from damageest.stages.align import Align
from damageest.stages.boolean import Boolean
from damageest.stages.boundary import Boundary
from damageest.stages.cluster import Cluster
from damageest.stages.enclose import EncloseAll
from damageest.stages.part import ReadPart
from damageest.stages.reconstruct import Reconstruct
from damageest.stages.repair import Repair
from damageest.stages.sample import Sample
from damageest.stages.scan import ReadScan
from damageest.stages.segment import Segment
from damageest.together import enclosed

ACQUIRE: Route = (ReadPart, ReadScan, measured, Sample, Align, placed, Segment, Cluster, damaged)
BY_SITE: Route = (each_cluster, Reconstruct, Boundary, enclosed, Repair, Boolean, settled)
AT_ONCE: Route = (EncloseAll, each_enclosure, Boolean, settled)
CLOSE: Route = (numbered, allowed, apart, gather)

ROUTES: dict[str, Route] = {
    "surface": (*ACQUIRE, *BY_SITE, *CLOSE),
    "implicit": (*ACQUIRE, *AT_ONCE, *CLOSE),
    "octree": (*ACQUIRE, *AT_ONCE, *CLOSE),
    "auto": (*ACQUIRE, either(AT_ONCE, BY_SITE), *CLOSE),
}
