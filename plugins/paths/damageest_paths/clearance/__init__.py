"""How far the nozzle stays from what it must not touch, and which tool axes are free."""

# axes.py: chooses the tool axes of passes so that the nozzle touches nothing
# boxes.py: a tree of boxes over the triangles of obstacles, in which distances to the nozzle are found
# bridging.py: bridges the breaks of passes, where the tool turns over a longer way
# clearance.py: how far the nozzle stays from what it must not touch
# compiling.py: functions that the Numba library compiles
# descent.py: bounds on the distance of a nozzle that is a solid of revolution
# gauges.py: what measures the nozzle's distances along a path
# loops.py: distances of the nozzle from a tree of boxes, in loops that the Numba library compiles
# obstacles.py: what the nozzle must not touch, as small triangles in a tree of boxes
# pose_table.py: the nozzle's distances along passes with each of many tool axes
# turning.py: lets the tool axis turn along a pass
