"""The exact damage volume of a site: the part's solids cut by one surface after another, until a check passes."""

# _attempts.py: the surfaces that are tried as tools that cut a damage volume out of the part, in their order
# _balance.py: by how much a cut has to be moved so that the exact damage volume is as large as the mesh
# _pieces.py: which pieces of the part's solids, split by a cut, are the damage volume
# check_pieces.py: checks an exact damage volume against the mesh and the scan before it is written
# crossed.py: faces of a CAD file that cross one another
# exact_damage.py: finds the exact damage volume of a site
# left.py: what is left of a CAD solid where a site has no exact form
