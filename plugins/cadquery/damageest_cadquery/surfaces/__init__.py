"""The open surfaces that cut a damage volume out of the part: planes, recognised faces, splines, triangles."""

# _flatten.py: maps an open surface of one rim onto a disk, so that one spline can follow it wherever it bends
# _outlines.py: outlines of triangles in a plane
# _recognise.py: divides an inner damage surface into planes, cylinders and spheres
# _untangle.py: takes crossings out of an open surface
# flat_faces.py: flat faces of a simplified surface
# open_surface.py: the open surface that cuts a damage volume out of the part
# polyhedron.py: a surface of few flat faces
# recognised.py: faces of planes, cylinders and spheres through an inner damage surface that is made of them
# splines.py: splines through an inner damage surface, which go on beyond its rim until they have left the part
