"""From a rough pose to one that fits: robust fits, and whether such a pose explains the scan."""

# by_patches.py: the last step of the fit
# check_pose.py: checks whether a fitted pose explains the scan
# largest_piece.py: the pose in which the largest consistent share of the skin is intact
# robust_fit.py: robust fit of scan points to the triangles of the part
