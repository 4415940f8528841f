"""Reads CAD files: solids, names, colours, datums and tolerances, and the triangles of their faces."""

# _part21.py: entities of a STEP file (ISO 10303-21), as far as its product and manufacturing information needs them
# _sew.py: surfaces that a file holds in place of a solid
# claims.py: tolerances that a CAD file claims for its edges and corners without need
# colours.py: colours of the faces in a STEP file
# list_faces.py: lists the faces of a CAD model
# pmi.py: datums, datum systems and tolerances of a STEP AP242 file, with the CAD faces that they refer to
# read.py: reading CAD files into OpenCASCADE solids, with their unit and the names of their faces
# tessellate.py: triangulates OpenCASCADE solids without gaps
# _mesh.py: calls its mesher, and again where it leaves faces without triangles
