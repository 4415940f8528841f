"""The layers of a deposit: planes, or surfaces along the floor of the cavity."""

# aims.py: where in a layer the middles of beads may lie
# anchor.py: where the first layer of planes lies
# conformal.py: plans layers that follow the floor of the cavity
# directions.py: build directions that are tried, and the deposit cut into parts with a direction each
# placing.py: places the lines of a layer along a floor as passes
# planar.py: plans layers that are planes across the build direction
# unfilled.py: what of a deposit has no bead in layers along a floor
