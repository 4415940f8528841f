"""The nozzle and the beam: their shapes."""

# mesh_files.py: meshes that a job names for the nozzle and for what it must not touch
# nozzle.py: the nozzle as a solid of revolution, and as a mesh for distances
# sight.py: the beam of energy, powder or wire between the nozzle's tip and the bead
# trees.py: meshes as the FCL library has them
