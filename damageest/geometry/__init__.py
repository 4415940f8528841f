"""Shared geometry: the toolbox of stages and of plugin authors.

Every name without a leading underscore is public. Each module answers one question and is imported by its own name,
for example ``from damageest.geometry.distance import signed_distance``. Nothing here imports a stage, the pipeline or
the job; only `damageest.artefacts` and `damageest.errors` are needed.

Conventions, unless a docstring says otherwise:

- Coordinates are float64 arrays (N,3). All lengths of one call are in one unit of the caller's choice, and all
  coordinates of one call are in one frame. Areas and volumes are in the square and the cube of that unit.
- Faces are int64 arrays (F,3) of vertex indices, counter-clockwise seen from outside. Indices are int64.
- N points, M of them chosen or made, V vertices, F faces, E edges, K neighbours.
- Inputs are never edited. Random choices use a seed or a generator that the caller gives.
- An `InputError` reports a fault of a file or array, a `StageError` a computation that gives no usable result.
"""
