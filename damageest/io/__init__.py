"""Readers and writers of mesh and point formats, and conversions to objects of other libraries."""

# The modules:
# points/: scan formats
# meshes.py, triangles.py, polygons.py: meshes; files of triangles, and of other faces
# scans.py, large_scans.py, scan_folders.py: scans whole, in pieces, in folders
# scan_notes.py: notes on units and confidence
# parts.py, part_store.py: parts; what is kept of them for later runs
# forms.py: forms of measured parts
# files.py, digests.py: checks before reading, hashes
# conversions.py, given.py: objects of other libraries, out and in
# kept_values.py: saved results
# colours.py: colours of sites and layers
# section_files.py: tables and drawings of sections
# file_memory.py, three_mf_limits.py: limits on what a file may cost
# for_programs.py: one line of JSON
