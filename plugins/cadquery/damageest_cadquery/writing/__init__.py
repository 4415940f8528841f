"""Writes STEP files, and reads each back before it counts."""

# _canonical.py: numbers the entities of a STEP file by what they say, so that equal content gives equal bytes
# _header.py: sets the header and the product data of a STEP model before it is written
# assembly.py: writes shapes as STEP AP242 with names and colours of solids and faces, alone or as an assembly
# patch.py: writes a B-spline surface as STEP: one face, which ends at its rims
# readback.py: reads a written STEP file back and compares it with the shape that it was to hold
# step.py: writes solids as STEP: planar faces, the job's unit, a product name, and the same bytes each time
# write_shapes.py: writes named shapes to a STEP file that holds them when it is read back
