"""Which poses are possible: pairs of points, scores of thousands of poses, and which of two the scan favours."""
