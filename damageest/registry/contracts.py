"""The contracts in the order of the route, and the implementation that each has by default."""

from __future__ import annotations

from damageest.stages import Stage
from damageest.stages.adapt import Adapt
from damageest.stages.align import Align
from damageest.stages.allowance import Allowance
from damageest.stages.background import Background
from damageest.stages.boolean import Boolean
from damageest.stages.boundary import Boundary
from damageest.stages.cluster import Cluster
from damageest.stages.enclose import Enclose, EncloseAll
from damageest.stages.export import Export
from damageest.stages.part import ReadPart
from damageest.stages.path import Path
from damageest.stages.reconstruct import Reconstruct
from damageest.stages.repair import Repair
from damageest.stages.report import Report
from damageest.stages.sample import Sample
from damageest.stages.scan import ReadScan
from damageest.stages.segment import Segment

Contract = type[Stage]

DEFAULTS: dict[Contract, str] = {
    ReadPart: "file",
    ReadScan: "file",
    Sample: "edge_aware",
    Align: "register",
    Adapt: "auto",
    Segment: "mesh_distance",
    Cluster: "dbscan",
    Reconstruct: "pyvista",
    Boundary: "all_loops",
    Background: "bbox",
    Enclose: "divide",
    EncloseAll: "implicit",
    Repair: "none",
    Boolean: "manifold",
    Allowance: "none",
    Path: "none",
    Export: "files",
    Report: "html",
}
"""Contract to the name of its default implementation, in the order of the route. Stage `enclose` has two contracts: one
that goes site by site and one that takes all sites at once."""

SURFACE_ONLY: tuple[Contract, ...] = (Reconstruct, Boundary, Background, Enclose, Repair)
"""Contracts that only the method `surface` uses."""

STAGES: tuple[str, ...] = tuple(dict.fromkeys(contract.stage for contract in DEFAULTS))


def contract_of(cls: type) -> Contract | None:
    """The contract that an implementation derives from; None where it derives from none."""
    return next((contract for contract in DEFAULTS if issubclass(cls, contract)), None)
