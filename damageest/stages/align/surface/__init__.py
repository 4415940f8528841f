"""The part's skin and the points of a scan, in a form in which thousands of poses are compared quickly."""

# frame.py: scan and part, centred and scaled so that the diagonal of the part is 1
# oriented_points.py: draws few, evenly spread, oriented points from a scan of any size and density
# plane_grid.py: a grid of planes around the part
