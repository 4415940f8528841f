"""Which poses are possible: pairs of points, scores of thousands of poses, and which of two the scan favours."""

# pairs.py: candidate poses, from pairs of oriented points that are congruent on scan and part
# search.py: selects few good poses from many rough ones
# weigh_poses.py: which of two poses the scan favours, by the patches that distinguish them
