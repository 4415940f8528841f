"""What is drawn, and what a click meets."""

# The modules:
# scene.py: layers of the 3D view
# pick.py, faces.py: what a click meets; faces of the part
# colours.py, shade.py: colours of deviations, shading of points
# section.py, histogram.py: drawings beside the view
# pathview.py: a deposition path, played
