"""CAD solids that follow a part that was adapted to its scan."""

# _interpolate.py: B-splines through functions of one or two parameters, with as many knots as they need to follow
# adapted.py: the CAD solids of a part that was adapted to its scan, checked against its mesh
# moved.py: CAD solids moved by a displacement field, such as that of a part that was adapted to its scan
