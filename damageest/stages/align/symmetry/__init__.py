"""Which of the poses that fit alike: symmetries of the part, the choice, and the words where several remain."""

# _counterparts.py: poses that a near symmetry of the part makes of the best one
# _turns.py: rotations of the part about an axis that map it (nearly) onto itself
# ambiguity.py: what is said where a scan fits the part in more than one pose
# choose.py: chooses the pose that fits the scan best, and lists the others that fit as well
# prepare_part.py: what an alignment computes from the part alone
# symmetries.py: the symmetries of a part
