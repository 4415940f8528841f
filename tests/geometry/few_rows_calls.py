"""A call of each public function of the toolbox with a few rows, and what refuses them.

Whoever adds a function to the toolbox adds a line here.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from damageest.artefacts import DisplacementField, Part, Samples, Sites
from damageest.geometry import (
    barycentric,
    bodies,
    body_repair,
    complement,
    cutting,
    depth_steps,
    distance,
    duplicates,
    edges,
    face_labels,
    far_points,
    filled,
    healing,
    height_spline,
    local_fits,
    long_faces,
    loops,
    make_part,
    morton,
    neighbourhoods,
    noise,
    open_surfaces,
    orientation,
    patches,
    pieces,
    pieces_of_part,
    point_pieces,
    poisson,
    polygons,
    pseudonormals,
    rays,
    refinement,
    remaining,
    sampling,
    scan_field,
    shapes,
    sheets,
    skin_near,
    slivers,
    smooth_faces,
    solids,
    spreading,
    stacks,
    stiff_modes,
    tables,
    touching,
    transforms,
    undoing,
    units,
    vectors,
    views,
    voxels,
)
from tests.geometry.few_rows import (
    CUBE,
    PART,
    Rows,
    call_both,
    call_by_cells,
    call_crop_points,
    call_crops,
    call_extract_contour,
    call_fit_contour,
    call_gather,
    call_grid,
    call_insert_points,
    call_join_pieces,
    call_neighbours,
    call_orientation,
    call_poisson,
    call_query,
    call_rays,
    call_refine_at,
    call_sampling,
    call_selector,
    call_signed,
    call_threads,
    call_tree,
    call_voxel_grid,
    expect,
    surface,
)

STILL = DisplacementField(np.zeros(3), np.ones(3), np.zeros((4, 4, 4, 3)))
"""A field that moves nothing."""

CALLS: dict[str, Callable[[Rows], None]] = {
    "barycentric.find_barycentric": lambda r: expect(
        barycentric.find_barycentric(r.points[:, None] + np.eye(3), r.points), (r.count, 3)
    ),
    "bodies.label_pieces": lambda r: expect(bodies.label_pieces(r.mesh.faces), (len(r.mesh.faces),)),
    "body_repair.label_bodies": lambda r: expect(body_repair.label_bodies(r.mesh.faces)[0], (len(r.mesh.faces),)),
    "body_repair.orient_faces": lambda r: expect(body_repair.orient_faces(r.mesh.faces)[0], (len(r.mesh.faces), 3)),
    "body_repair.signed_volumes": lambda r: expect(
        body_repair.signed_volumes(r.mesh.vertices, r.mesh.faces, np.zeros(len(r.mesh.faces), int), 1), (1,)
    ),
    "body_repair.split_pinches": lambda r: expect(
        body_repair.split_pinches(r.mesh.vertices, r.mesh.faces, []), (None, 3), (None, 3)
    ),
    "body_repair.resolve_bodies": lambda r: expect(
        body_repair.resolve_bodies(r.mesh.vertices, r.mesh.faces, []), (None, 3), (None, 3)
    ),
    "complement.complement_part": lambda r: expect(complement.complement_part(PART, r.points, 1.0).faces, (24, 3)),
    "complement.complement_deviation": lambda r: expect(
        complement.complement_deviation(r.deviation).distance, (r.count,)
    ),
    "complement.complement_samples": lambda r: expect(
        complement.complement_samples(Samples(r.points, r.normals, r.numbers, r.numbers, 1.0)).normals, (r.count, 3)
    ),
    "complement.label_strays": lambda r: expect(
        complement.label_strays(r.deviation, 1, Sites(np.zeros(r.count, int), 0)).label, (r.count,)
    ),
    "contour.extract_contour": call_extract_contour,
    "contour.fit_contour": call_fit_contour,
    "crops.Crop": call_crops,
    "crops.BoxCrop": call_crops,
    "crops.CylinderCrop": call_crops,
    "crops.AboveCrop": call_crops,
    "crops.PieceCrop": call_crops,
    "crops.crop_points": call_crop_points,
    "cutting.cut_triangles": lambda r: expect(
        cutting.cut_triangles(r.mesh.vertices, r.mesh.faces, r.mesh.vertices[:, 0]),
        (None, 3),
        (None, 3),
        (None,),
        (None,),
    ),
    "depth_steps.measure_depth_step": lambda r: expect(np.asarray(depth_steps.measure_depth_step(r.points)), ()),
    "smooth_faces.label_smooth_faces": lambda r: expect(
        smooth_faces.label_smooth_faces(r.mesh.faces, r.mesh.face_normals, 0.9), (len(r.mesh.faces),)
    ),
    "sampling.place_along": lambda r: expect(
        sampling.place_along(r.mesh.vertices, r.mesh.faces[:, :2], 0.1), (None, 3)
    ),
    "shapes.Shape": lambda r: expect(
        shapes.Shape("cylinder", np.zeros(3), np.eye(3)[2], 1.0).find_slopes(r.points), (r.count, 6)
    ),
    "shapes.recognise_shape": lambda r: expect(np.asarray(shapes.recognise_shape(r.mesh.triangles) is None), ()),
    "skin_near.NearCubes": lambda r: expect(
        skin_near.find_cubes_near(CUBE, CUBE.vertices, CUBE.vertices, r.points, 1.0)[0].touches(r.mesh.triangles),
        (len(r.mesh.faces),),
    ),
    "skin_near.find_cubes_near": lambda r: expect(
        skin_near.find_cubes_near(CUBE, r.points, r.points, r.points, 1.0)[0].holds(r.points), (r.count,)
    ),
    "skin_near.sample_near": lambda r: expect(
        skin_near.sample_near(
            PART,
            skin_near.find_cubes_near(PART, r.points, r.points, r.points, 1.0)[0],
            skin_near.NearCubes.around(r.points, 1.0),
            5.0,
        ).points,
        (None, 3),
    ),
    "spreading.spread_on_faces": lambda r: expect(spreading.spread_on_faces(r.mesh, 0.5), (None, 3), (None,)),
    "spreading.spread_points": lambda r: expect(
        spreading.spread_points(r.mesh.triangles, np.arange(len(r.mesh.faces)), 0.5), (None, 3), (None,)
    ),
    "spreading.thin": lambda r: expect(spreading.thin(r.points, 0.5, 0.5), (None,)),
    "stacks.find_stacks": lambda r: expect(np.asarray(stacks.find_stacks(r.points) is None), ()),
    "stiff_modes.name_modes": lambda r: expect(np.asarray(stiff_modes.name_modes(r.points, r.points)[1]), ()),
    "undoing.undo": lambda r: expect(undoing.undo(STILL, r.points), (r.count, 3)),
    "undoing.cut_to_follow": lambda r: expect(undoing.cut_to_follow(r.mesh, np.copy, 1.0)[0], (None, 3)),
    "undoing.count_crossings": lambda r: expect(np.asarray(undoing.count_crossings(r.mesh)), ()),
    "undoing.find_crossings": lambda r: expect(undoing.find_crossings(r.mesh)[0], (None, 2)),
    "distance.SurfaceTree": call_tree,
    "distance.closest_on_mesh": call_both(lambda points, mesh: distance.closest_on_mesh(points, mesh).distance),
    "distance.keep_tree": lambda r: expect(distance.keep_tree(CUBE).closest(r.points).distance, (r.count,)),
    "distance.distance_to_mesh": call_both(distance.distance_to_mesh),
    "distance.distance_to_edges": lambda r: expect(
        distance.distance_to_edges(CUBE.vertices, r.mesh.vertices, r.mesh.faces[:, :2]), (8,)
    ),
    "distance.winding_number": call_both(distance.winding_number),
    "distance.is_inside": call_both(distance.is_inside),
    "distance.signed_distance": call_signed,
    "distance.run_libigl_pass": call_both(distance.run_libigl_pass),
    "pseudonormals.SignedMesh": call_both(
        lambda points, mesh: pseudonormals.SignedMesh(
            mesh.vertices, mesh.faces, long_faces.build_tree(mesh.vertices, mesh.faces), mesh.faces
        ).measure(points)[0]
    ),
    "distance_by_cells.signed_distance_by_cells": call_by_cells,
    "duplicates.list_distinct": lambda r: expect(duplicates.list_distinct(r.numbers), (None,)),
    "duplicates.order_integers": lambda r: expect(duplicates.order_integers(r.numbers), (r.count,)),
    "duplicates.group_integers": lambda r: expect(duplicates.group_integers(r.numbers), (None,), (r.count,), (None,)),
    "duplicates.find_members": lambda r: expect(duplicates.find_members(np.arange(5), r.numbers), (5,)),
    "duplicates.list_used": lambda r: expect(duplicates.list_used(r.mesh.faces), (3 * len(r.mesh.faces),)),
    "edges.list_edges": lambda r: expect(edges.list_edges(r.mesh.faces), (3 * len(r.mesh.faces), 2)),
    "duplicates.find_duplicates": lambda r: expect(duplicates.find_duplicates(r.points), (None,), (r.count,)),
    "filled.find_filled": lambda r: expect(filled.find_filled(r.points, 0.1), (r.count,)),
    "far_points.find_far": lambda r: expect(far_points.find_far(r.points, 1.0), (r.count,)),
    "healing.heal": lambda r: expect(healing.heal(r.mesh.vertices, r.mesh.faces)[1], (None, 3)),
    "height_spline.fit_height_plane": lambda r: expect(height_spline.fit_height_plane(r.mesh)[0], (3, 3)),
    "height_spline.fit_height_spline": lambda r: expect(
        height_spline.fit_height_spline(r.points, 2)[1], (None, None, 3)
    ),
    "height_spline.fit_parametric_spline": lambda r: expect(
        height_spline.fit_parametric_spline(r.points[:, :2], r.points, 2)[1], (None, None, 3)
    ),
    "local_fits.smooth_points": lambda r: expect(
        local_fits.smooth_points(r.points, 0.1), (r.count, 3), (r.count, 3), (r.count,)
    ),
    "local_fits.average_points": lambda r: expect(
        local_fits.average_points(r.points, r.ones, 0.1, np.arange(r.count)), (r.count, 3), (r.count, 3)
    ),
    "long_faces.build_tree": lambda r: expect(
        long_faces.build_tree(CUBE.vertices, CUBE.faces)[2], (len(CUBE.faces), 3)
    ),
    "long_faces.cut_long_faces": lambda r: expect(
        long_faces.cut_long_faces(r.mesh.vertices, r.mesh.faces)[1], (None, 3)
    ),
    "loops.trace_loops": lambda r: [expect(loop, (3,)) for loop in loops.trace_loops(r.mesh.faces)] and None,
    "loops.trace_rims": lambda r: [expect(loop, (None,)) for loop in loops.trace_rims(surface(r))] and None,
    "make_part.make_part": lambda r: expect(make_part.make_part(r.mesh.vertices, r.mesh.faces).faces, (None, 3)),
    "neighbourhoods.find_nearby": lambda r: expect(
        (
            neighbourhoods.find_nearby(r.points, CUBE.vertices, 1.0),
            neighbourhoods.find_nearby(CUBE.vertices, r.points, 1.0),
        ),
        (None,),
        (None,),
    ),
    "neighbourhoods.gather_around": call_gather,
    "neighbourhoods.query_at_few": lambda r: expect(
        neighbourhoods.query_at_few(CUBE.vertices, r.points, 2, r.rng)[0], (r.count, 2)
    ),
    "neighbourhoods.find_in_box": lambda r: expect(
        neighbourhoods.find_in_box(r.points, np.full(3, -1e9), np.full(3, 1e9)), (r.count,)
    ),
    "neighbourhoods.thin_points": lambda r: expect(
        neighbourhoods.thin_points(r.points, 0.1), (None, 3), (None,), (None,)
    ),
    "neighbourhoods.pick_at_most": lambda r: expect(neighbourhoods.pick_at_most(r.points, 0.1, 5, 2.0), (None,)),
    "neighbourhoods.pick_one_per_cube": lambda r: expect(neighbourhoods.pick_one_per_cube(r.points, 0.1), (None,)),
    "neighbourhoods.find_neighbours": call_neighbours,
    "neighbourhoods.make_tree": call_query,
    "neighbourhoods.query_neighbours": call_query,
    "neighbourhoods.measure_local_areas": lambda r: expect(neighbourhoods.measure_local_areas(r.points), (r.count,)),
    "noise.find_least_depth": lambda r: expect(noise.find_least_depth(r.points[:, 0], 0.1, 0.0, 0.1), (None,)),
    "noise.measure_noise_and_spacing": lambda r: expect(np.array(noise.measure_noise_and_spacing(r.points)), (2,)),
    "noise.measure_scatter": lambda r: expect(noise.measure_scatter(np.zeros((r.count, 9, 3))), (r.count,)),
    "noise.measure_quiet_noise": lambda r: expect(np.array([noise.measure_quiet_noise(r.points)]), (1,)),
    "open_surfaces.centre_points": lambda r: expect(open_surfaces.centre_points(r.points), (3,)),
    "open_surfaces.thin_for_surface": lambda r: expect(open_surfaces.thin_for_surface(r.points, 1.0), (None, 3)),
    "open_surfaces.orient_points": lambda r: expect(
        open_surfaces.orient_points(r.points, PART, 1.0, 0.1), (None, 3), (None, 3)
    ),
    "open_surfaces.draw_to_points": lambda r: expect(
        open_surfaces.draw_to_points(r.mesh.vertices, r.mesh.faces, r.points, r.points), (None, 3)
    ),
    "open_surfaces.trim_surface": lambda r: expect(
        open_surfaces.trim_surface(r.mesh.vertices, r.mesh.faces, r.points, 1e6, PART, 1e6).faces, (None, 3)
    ),
    "open_surfaces.take_largest_piece": lambda r: expect(open_surfaces.take_largest_piece(r.mesh.faces), (None, 3)),
    "open_surfaces.faces_skin": lambda r: expect(np.asarray(open_surfaces.faces_skin(surface(r), PART)), ()),
    "orientation.turn_toward_void": call_orientation,
    "orientation.find_signs": lambda r: expect(orientation.find_signs(r.points, r.points, r.points[:, 0]), (r.count,)),
    "pieces.find_pieces": lambda r: expect(np.asarray(pieces.find_pieces(CUBE, r.points, r.numbers, 0.5)[1]), ()),
    "pieces.join_pieces": call_join_pieces,
    "pieces_of_part.is_piece": lambda r: (
        pieces_of_part.is_piece(r.points, Part(CUBE.vertices, CUBE.faces), np.eye(4)) and None
    ),
    "point_pieces.number_pieces": lambda r: expect(point_pieces.number_pieces(r.points, 1.0), (r.count,)),
    "poisson.Grid": call_grid,
    "poisson.solve_poisson": call_poisson(poisson.solve_poisson),
    "poisson.solve_coarse_to_fine": call_poisson(poisson.solve_coarse_to_fine),
    "polygons.triangulate_polygons": lambda r: expect(
        polygons.triangulate_polygons(r.mesh.vertices, r.mesh.faces.ravel(), np.full(len(r.mesh.faces), 3)).faces,
        (len(r.mesh.faces), 3),
    ),
    "rays.RayCaster": call_rays,
    "rays.measure_thickness": lambda r: expect(rays.measure_thickness(CUBE, r.points, r.normals) > 0, (r.count,)),
    "rays.prepare_rays": lambda r: expect(rays.prepare_rays(r.mesh).find_first(r.points, r.normals)[1], (r.count,)),
    "refinement.find_nearest": lambda r: expect(refinement.find_nearest(CUBE, r.points), (r.count,), (r.count, 3)),
    "refinement.refine_at": call_refine_at,
    "refinement.halve_edges": lambda r: expect(refinement.halve_edges(r.mesh, 5.0).faces, (None, 3)),
    "refinement.cut_into_cells": lambda r: expect(refinement.cut_into_cells(r.mesh, 5.0)[1], (None,)),
    "refinement.cut_part": lambda r: expect(refinement.cut_part(PART, 5.0 + r.count).faces, (None, 3)),
    "refinement.bisect_faces": lambda r: expect(
        refinement.bisect_faces(r.mesh.vertices, r.mesh.faces, np.arange(len(r.mesh.faces))),
        (None, 3),
        (None, 3),
        (None,),
    ),
    "refinement.insert_points": call_insert_points,
    "sampling.sample_by_area": call_sampling,
    "sheets.find_own_sheet": lambda r: expect(sheets.find_own_sheet(np.zeros((r.count, 9, 3))), (r.count, 9)),
    "sheets.measure_spread": lambda r: expect(
        sheets.measure_spread(np.zeros((r.count, 4, 3)), np.zeros((r.count, 4), bool)), (r.count, 3, 3)
    ),
    "sheets.query_own_sheet": lambda r: expect(
        sheets.query_own_sheet(neighbourhoods.make_tree(r.points), r.points, r.points, 1)[1], (r.count, None)
    ),
    "selectors.Selector": call_selector,
    "face_labels.carry_labels": lambda r: expect(
        face_labels.carry_labels(CUBE.vertices, CUBE.faces[: r.count], CUBE, np.arange(12)), (r.count,)
    ),
    "slivers.find_slivers": lambda r: expect(slivers.find_slivers(r.mesh.vertices, r.mesh.faces), (len(r.mesh.faces),)),
    "solids.compose_shells": lambda r: expect(
        np.asarray(solids.compose_shells([solids.to_manifold(CUBE)] * r.count).num_tri()), ()
    ),
    "solids.to_manifold": lambda r: expect(np.asarray(solids.to_manifold(r.mesh).num_tri()), ()),
    "solids.concatenate_meshes": lambda r: expect(
        solids.concatenate_meshes([CUBE] * r.count), (8 * r.count, 3), (12 * r.count, 3), (12 * r.count,)
    ),
    "solids.unite": lambda r: expect(np.asarray(solids.unite([CUBE] * r.count).volume()), ()),
    "remaining.lift_faces": lambda r: expect(
        remaining.lift_faces(r.mesh, np.zeros(len(r.mesh.faces), bool), 0.1).faces, (len(r.mesh.faces), 3)
    ),
    "solids.iou": lambda r: expect(np.asarray(solids.iou(r.mesh, CUBE)), ()),
    "threads.cut_evenly": call_threads,
    "threads.map_in_threads": call_threads,
    "touching.merge_close": lambda r: expect(
        touching.merge_close(r.mesh.vertices, r.mesh.faces, 0.1), (None, 3), (None, 3)
    ),
    "tables.find_table": lambda r: tables.find_table(r.points, 0.1) and None,
    "transforms.move_points": lambda r: expect(transforms.move_points(r.points, np.eye(4)), (r.count, 3)),
    "transforms.make_motions": lambda r: expect(
        transforms.make_motions(np.hstack([r.points, r.points])), (r.count, 4, 4)
    ),
    "transforms.move_mesh": lambda r: expect(transforms.move_mesh(r.mesh, np.eye(4)).faces, (len(r.mesh.faces), 3)),
    "transforms.remove_rigid": lambda r: expect(transforms.remove_rigid(r.points, r.points, r.ones), (r.count, 3)),
    "units.diagnose_scale": lambda r: units.diagnose_scale(r.points, CUBE.vertices) and None,
    "units.describe_size": lambda r: units.describe_size(r.points, "mm") and None,
    "units.question_size": lambda r: units.question_size(0.1, r.points, "mm") and None,
    "units.diagnose_size": lambda r: units.diagnose_size(r.points, "mm") and None,
    "scan_field.ScanField": lambda r: expect(scan_field.ScanField.measure(r.part, r.scan, 0.1).feet, (r.count, 3)),
    "patches.Patches": lambda r: expect(patches.Patches.on_skin(r.points, r.normals, 0.5).mean(r.points), (None, 3)),
    "vectors.cross_corners": lambda r: expect(vectors.cross_corners(r.mesh.triangles), (len(r.mesh.faces), 3)),
    "vectors.measure_longest_edges": lambda r: expect(
        vectors.measure_longest_edges(r.mesh.triangles), (len(r.mesh.faces),)
    ),
    "vectors.measure_to_sphere": lambda r: expect(
        vectors.measure_to_sphere(r.points, vectors.normalise(r.points + 1.0), np.zeros(3), 100.0), (r.count,)
    ),
    "vectors.normalise": lambda r: expect(vectors.normalise(r.points), (r.count, 3)),
    "views.choose_view": lambda r: expect(
        views.choose_view(rays.RayCaster(CUBE), r.mesh, CUBE.bounds, 10.0).direction, (3,)
    ),
    "voxels.VoxelGrid": call_voxel_grid,
    "voxels.measure_bounds": lambda r: expect(voxels.measure_bounds(r.points), (2, 3)),
    "voxels.number_cubes": lambda r: expect(voxels.number_cubes(r.points, 0.5), (r.count, 3), (r.count,)),
    "morton.encode_cells": lambda r: expect(morton.encode_cells(np.zeros((r.count, 3), int)), (r.count,)),
    "voxels.order_by_place": lambda r: expect(voxels.order_by_place(r.points), (r.count,)),
    "voxels.measure_area": lambda r: expect(np.asarray(voxels.measure_area(r.points, 0.5)), ()),
    "voxels.number_faced_cubes": lambda r: expect(
        voxels.number_faced_cubes(r.points, r.normals, 0.5), (r.count, 3), (r.count,)
    ),
}
"""What is called, by module and name; it checks the shapes of what comes back."""

WITHOUT_ROWS: dict[str, str] = {
    "nozzle.place_tool": "takes one point",
    "transforms.turn_to_axis": "takes one vector",
    "vectors.to_vector": "takes one vector",
    **dict.fromkeys(
        (
            "alike.have_same_shape", "alike.measure_radii",
            "bodies.split_bodies", "bodies.split_shells", "rounding.round_to_single", "simplification.simplify_within",
            "lost_depth.LostDepth", "edges.pair_faces",
            "lost_depth.measure_lost_depth",
            "shells.Shells", "shells.drop_unused_vertices", "shells.label_components", "shells.to_body",
            "bubbles.find_bubbles", "bubbles.fill_bubbles", "near_faces.measure_shortfall",
            "near_faces.name_nearest_skin",
            "skin.extract_ids", "skin.find_inner_faces", "skin.take_inner_surface", "skin.take_lost_skin",
            "touching.separate_touching", "remaining.subtract_from_part",
        ),
        "takes solids, which have at least four triangles",
    ),
    **dict.fromkeys(
        ("solids.subtract_lost", "solids.to_arrays", "solids.to_solid", "touching.separate_sheets"),
        "takes bodies of manifold3d",
    ),
    **dict.fromkeys(
        ("isosurface.extract_region", "poisson.make_grid", "poisson.refine_field"),
        "takes the values or sides of a grid",
    ),
    **dict.fromkeys(
        (
            "open_surfaces.choose_cell", "selectors.Facing", "selectors.HalfSpace", "selectors.StrictMapping",
            "selectors.find_face", "threads.count_cores", "threads.count_threads", "threads.use_threads",
            "transforms.invert_pose",
            "vectors.spread_directions", "units.canonical_unit", "units.unit_factor",
        ),
        "takes single values",
    ),
    **dict.fromkeys(
        (
            "tables.Table",
            "distance.Closest", "families.Errors", "families.Family", "pieces.JoinedPieces", "pieces.Piece",
            "polygons.PolygonTriangles",
            "pseudonormals.keep_signed_mesh", "rays.Crossings", "stiff_modes.StiffMode", "views.View",
        ),
        "is a result",
    ),
    **dict.fromkeys(
        ("families.build_family", "families.leave_one_out", "families.predict", "transforms.find_nearest_motion"),
        "takes places that are spread over the skin of a part",
    ),
    "families.widen": "takes a number of parts",
}  # fmt: skip
"""Why a public name takes no number of rows."""

NO_TRIANGLE = r"no distance: the target has no (triangle|edge)"
FEW_POINTS = r"no inner damage surface could be reconstructed from \d points"
NO_VOLUME = r"holds no triangles|encloses no volume"
REFUSALS: dict[str, str] = {
    "body_repair.resolve_bodies": NO_VOLUME,
    "crops.crop_points": r"leaves no points; there were none before it",
    "distance.SurfaceTree": NO_TRIANGLE,
    "distance.closest_on_mesh": NO_TRIANGLE,
    "distance.distance_to_mesh": NO_TRIANGLE,
    "distance.distance_to_edges": NO_TRIANGLE,
    "distance.signed_distance": NO_TRIANGLE,
    "distance.run_libigl_pass": NO_TRIANGLE,
    "pseudonormals.SignedMesh": NO_TRIANGLE,
    "healing.heal": NO_VOLUME,
    "height_spline.fit_height_plane": r"no plane for a surface without area",
    "height_spline.fit_height_spline": r"no spline for \d points",
    "height_spline.fit_parametric_spline": r"no spline for \d points",
    "loops.trace_rims": r"the damage surface has no rim",
    "make_part.make_part": NO_VOLUME,
    "open_surfaces.centre_points": FEW_POINTS,
    "open_surfaces.thin_for_surface": FEW_POINTS,
    "open_surfaces.orient_points": FEW_POINTS,
    "open_surfaces.trim_surface": r"no inner damage surface near the points",
    "sampling.sample_by_area": r"no place for \d points on \d triangles",
    "solids.to_manifold": r"manifold3d rejects the mesh",
    "solids.iou": r"manifold3d rejects the mesh",
    "voxels.measure_bounds": r"there are no points, and so no bounds",
}
"""What a function that has no answer for so few rows says, as a regular expression."""
