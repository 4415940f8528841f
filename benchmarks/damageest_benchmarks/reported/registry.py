"""The reports: the address of each, what it tells, how it is made anew, and what a run should say of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from damageest_benchmarks.families.scene import Draw
from damageest_benchmarks.reported import meshed, models, placed, sensors, thinned


@dataclass(frozen=True)
class Reported:
    """``address`` of the report after https://; ``kind`` of trouble; ``make`` gives part, scan, truth and pose.

    ``wanted``: right where the damage can be measured all the same, said where something else is to be doubted or
    refused, either where both are good. Accepted and wrong is never good.
    """

    address: str
    kind: str
    make: Callable[[], Draw]
    wanted: Literal["right", "said", "either"]


def _hub(where: str, kind: str, make: Callable[[], Draw], wanted: Literal["right", "said", "either"]) -> Reported:
    return Reported(f"github.com/{where}", kind, make, wanted)


REPORTS: tuple[Reported, ...] = (
    _hub("isl-org/Open3D/issues/6172", "points in the middle of voxels", thinned.middles_of_cubes, "either"),
    _hub("isl-org/Open3D/issues/503", "means of voxels", thinned.means_of_cubes, "right"),
    _hub("laspy/laspy/issues/318", "coordinates rounded", thinned.rounded_coordinates, "either"),
    _hub(
        "CloudCompare/CloudCompare/issues/1732",
        "one coordinate in steps",
        thinned.one_coordinate_in_steps,
        "either",
    ),
    _hub("CloudCompare/CloudCompare/issues/2371", "one coordinate lost", thinned.saturated_coordinate, "said"),
    _hub(
        "sp4cerat/Fast-Quadric-Mesh-Simplification/issues/37",
        "flats without vertices",
        thinned.flats_without_vertices,
        "either",
    ),
    _hub("isl-org/Open3D/issues/2855", "strict outlier filter", thinned.strict_outlier_filter, "either"),
    _hub("MRPT/mrpt/issues/230", "zeros for no answer", thinned.zeros_for_no_answer, "right"),
    _hub("andyzeng/tsdf-fusion-python/issues/22", "second layer inside", meshed.second_layer, "said"),
    _hub("isl-org/Open3D/issues/2390", "smoothed until it shrank", meshed.smoothed_until_it_shrank, "either"),
    _hub("mkazhdan/PoissonRecon/issues/262", "bore closed by software", meshed.bore_closed_by_software, "right"),
    _hub(
        "mkazhdan/PoissonRecon/issues/153",
        "balloon over unseen skin",
        meshed.balloon_over_what_was_not_seen,
        "either",
    ),
    _hub("mikedh/trimesh/issues/918", "scan cropped and capped", meshed.cropped_and_capped, "either"),
    _hub("mattools/matGeom/issues/51", "scan cropped", meshed.cropped, "right"),
    _hub(
        "BlueQuartzSoftware/simplnx/issues/1706",
        "vertices without faces",
        meshed.vertices_without_faces,
        "right",
    ),
    _hub("autotwin/automesh/issues/256", "staircase of labels", meshed.staircase_of_labels, "either"),
    _hub("Slicer/Slicer/issues/6773", "one axis stretched", meshed.wrong_distance_of_slices, "either"),
    _hub("cnr-isti-vclab/meshlab/issues/824", "web between bars", meshed.window_closed_by_a_web, "right"),
    _hub("isl-org/Open3D/issues/4710", "pit under a lid", meshed.pit_under_a_lid, "either"),
    _hub("mkazhdan/PoissonRecon/issues/125", "front behind back", meshed.both_sides_crossed, "said"),
    Reported(
        "sensing.konicaminolta.asia/learning-center/accurately-scan-thin-object/",
        "sides of a plate too near",
        meshed.plate_too_thin,
        "said",
    ),
    _hub("LibreScanner/horus/issues/79", "two lasers, two sizes", sensors.two_lasers_two_sizes, "either"),
    _hub(
        "mariolukas/FabScanPi-Server/issues/149",
        "table turns less than told",
        sensors.table_turns_less_than_told,
        "either",
    ),
    _hub("jzhzhang/ROSEFusion/issues/14", "drift round the part", sensors.drift_round_the_part, "either"),
    _hub("realsenseai/librealsense/issues/4939", "planes as bowls", sensors.planes_as_bowls, "either"),
    _hub("ifm/ifm3d/issues/118", "mirrored below the floor", sensors.mirrored_below_the_floor, "right"),
    _hub("realsenseai/librealsense/issues/12887", "edges too shallow", sensors.edges_too_shallow, "either"),
    _hub("ifm/ifm3d/issues/232", "light between walls", sensors.light_between_walls, "either"),
    Reported("www.mdpi.com/1996-1944/16/18/6165", "spray layer", sensors.spray_layer, "right"),
    Reported(
        "docs.shining3d.com/einscan-h2/1.2.0/en-us/mesh/", "markers on the skin", sensors.markers_on_the_skin, "right"
    ),
    _hub(
        "SICKAG/sick_safetyscanners/issues/67",
        "band of reflective tape",
        sensors.band_of_reflective_tape,
        "right",
    ),
    _hub("isl-org/Open3D/issues/928", "floor of the room", sensors.floor_of_the_room, "right"),
    _hub("realsenseai/librealsense/issues/4231", "old surface persists", sensors.old_surface_persists, "either"),
    _hub("CloudCompare/CloudCompare/issues/1976", "wrong side at a wedge", sensors.wedge_with_a_chip, "right"),
    _hub("NVlabs/FoundationPose/issues/395", "turned by a tooth", placed.turned_by_a_tooth, "right"),
    _hub(
        "leggedrobotics/perfectlyconstrained/issues/6",
        "cylinder at any angle",
        placed.cylinder_at_any_angle,
        "right",
    ),
    _hub("opencv/opencv_contrib/issues/464", "one flat face", placed.one_flat_face, "said"),
    _hub("isl-org/Open3D/issues/4319", "patch round the damage", placed.patch_round_the_damage, "either"),
    _hub("RePAIRProject/AAFR/issues/9", "fragment of the part", placed.fragment_of_the_part, "either"),
    _hub("PointCloudLibrary/pcl/issues/4485", "two pieces, one turned over", placed.two_pieces_apart, "said"),
    _hub("ecto/vcad/issues/161", "loss flush with faces", placed.flush_notch, "right"),
    _hub(
        "CloudCompare/CloudCompare/issues/571",
        "normals wrong in patches",
        placed.normals_wrong_in_patches,
        "right",
    ),
    _hub("CGAL/cgal/issues/7982", "normals inward", placed.normals_inward, "right"),
    _hub(
        "CloudCompare/CloudCompare/issues/1928",
        "normals of a mirrored half",
        placed.normals_of_a_mirrored_half,
        "right",
    ),
    _hub(
        "cnr-isti-vclab/meshlab/issues/1621",
        "normals that are no numbers",
        placed.normals_that_are_no_numbers,
        "right",
    ),
    _hub("CadQuery/cadquery/issues/19", "model of coarse facets", models.coarse_facets, "either"),
    _hub("isl-org/Open3D/issues/3027", "triangles not oriented", models.triangles_not_oriented, "right"),
    _hub("mikedh/trimesh/issues/2156", "model inside out", models.model_inside_out, "right"),
    _hub("FreeCAD/FreeCAD/issues/8549", "sawtooth on round edges", models.sawtooth_on_round_edges, "either"),
    _hub("isl-org/Open3D/issues/7045", "model not closed", models.model_not_closed, "either"),
)
