"""The built-in stages, which come in through the same hook as a third party's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from damageest.registry.hookspecs import hookimpl

if TYPE_CHECKING:
    from damageest.result import Conversion
    from damageest.rules import Rule, Term
    from damageest.stages import Stage
    from damageest.stages.export import PathWriter, Writer


@hookimpl
def damageest_stages() -> list[type[Stage]]:
    """Every built-in implementation. Imported here, so that loading the built-ins costs a command line little."""

    from damageest.stages.adapt.auto import AutoAdapt
    from damageest.stages.adapt.none import NoAdapt as NoAdapt
    from damageest.stages.adapt.smooth import Smooth
    from damageest.stages.align.constrained import Constrained
    from damageest.stages.align.icp import Icp
    from damageest.stages.align.none import KnownPose
    from damageest.stages.align.points import Points
    from damageest.stages.align.register import Register
    from damageest.stages.allowance.milling import Milling
    from damageest.stages.allowance.none import NoAllowance as NoAllowance
    from damageest.stages.background.bbox import BoundingBox
    from damageest.stages.background.build_volume import BuildVolume
    from damageest.stages.background.capsule import Capsule
    from damageest.stages.background.cylinder import CylinderBackground
    from damageest.stages.background.minkowski import Minkowski
    from damageest.stages.background.offset import Offset
    from damageest.stages.boolean.manifold import Manifold
    from damageest.stages.boundary.all_loops import AllLoops
    from damageest.stages.boundary.largest_loop import LargestLoop
    from damageest.stages.cluster.dbscan import Dbscan
    from damageest.stages.enclose.adaptive import Adaptive
    from damageest.stages.enclose.divide import Divide
    from damageest.stages.enclose.implicit import Implicit
    from damageest.stages.enclose.shortest_path import ShortestPath
    from damageest.stages.export.files import Files
    from damageest.stages.part.earlier_scan import EarlierScan
    from damageest.stages.part.file import PartFile
    from damageest.stages.part.reconstruct import PartFromScan
    from damageest.stages.path.none import NoPath as NoPath
    from damageest.stages.reconstruct.pyvista import PyVista
    from damageest.stages.reconstruct.signed_distance import SignedDistance
    from damageest.stages.repair.none import NoRepair as NoRepair
    from damageest.stages.report.html import Html
    from damageest.stages.report.none import NoReport as NoReport
    from damageest.stages.sample.edge_aware import EdgeAware
    from damageest.stages.sample.uniform import Uniform
    from damageest.stages.scan.file import ScanFile
    from damageest.stages.scan.simulate import Simulate
    from damageest.stages.segment.cloud_distance import CloudDistance
    from damageest.stages.segment.mesh_distance import MeshDistance

    return [
        PartFile, ScanFile, Simulate, EdgeAware, Register, Icp, Constrained, KnownPose, Points, NoAdapt, Smooth,
        AutoAdapt, MeshDistance, Dbscan, PyVista, LargestLoop, AllLoops, Offset, BoundingBox, Capsule,
        CylinderBackground, Minkowski, BuildVolume, ShortestPath, Adaptive, Divide, Implicit,
        NoRepair, Manifold, NoAllowance, Milling, NoPath, Files, Uniform, CloudDistance, SignedDistance,
        PartFromScan, EarlierScan, Html, NoReport,
    ]  # fmt: skip


@hookimpl
def damageest_rules() -> list[type[Rule]]:
    """Every built-in rule, in the order in which reasons of equal effect are listed."""
    from damageest.trust.doubts import list_rules

    return list_rules()


@hookimpl
def damageest_terms() -> list[type[Term]]:
    """Every built-in term of the intervals, in the order of the rows of a budget."""
    from damageest.trust.terms import list_terms

    return list_terms()


@hookimpl
def damageest_writers() -> Mapping[str, Writer]:
    """The formats that need no plugin."""
    from damageest.stages.export import Writer
    from damageest.stages.export.mesh_files import write_ply_bodies, write_stl_bodies
    from damageest.stages.export.threemf import write_threemf

    return {
        "stl": Writer(write_stl_bodies, single=True),
        "ply": Writer(write_ply_bodies),
        "3mf": Writer(write_threemf, one_file=True, single=True),
    }


@hookimpl
def damageest_path_writers() -> Mapping[str, PathWriter]:
    """The formats of paths that need no plugin."""
    from damageest.stages.export import PathWriter
    from damageest.stages.export.path_apt import write_apt
    from damageest.stages.export.path_csv import write_csv
    from damageest.stages.export.rs274 import check_rs274, write_rs274

    return {
        "csv": PathWriter(write_csv, "csv"),
        "apt": PathWriter(write_apt, "apt"),
        "rs274": PathWriter(write_rs274, "ngc", check_rs274),
    }


@hookimpl
def damageest_conversions() -> Mapping[str, Conversion]:
    """How a result shows itself in a notebook, and in a window."""
    from damageest.stages.report.html import open_plotter, show_in_notebook

    return {"html": show_in_notebook, "plotter": open_plotter}
