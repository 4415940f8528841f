"""Who decides the pose of a datum: single datums, datum systems (ISO 5459), and the fits that end with them."""

# _fit.py: fits one datum of a system
# _points.py: the scan points on one datum of a system, averaged in patches
# _words.py: what is said of a datum system
# by_system.py: the last fit of a pose by a datum system
# last_fit.py: from a rough pose to the final one
# option.py: the option `datum`: the faces that a pose is fitted to, together or as a system with precedence
# system.py: a datum system
