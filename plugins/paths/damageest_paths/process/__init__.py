"""What a path is planned with: frames, settings by place, trials of beads, waits."""

# calibration.py: width and height of a bead by the settings of the process
# channels.py: what the process is given besides its place
# frames.py: frames of a build direction
# interpass.py: the time between beads that lie next to each other, and waits that make it long enough to cool down
# places.py: what a place on a pass is like, as far as the process depends on it
# process.py: what a path is planned with, and what a plan consists of
# settings.py: gives each move of a path what the table of the process says, and the waits between neighbouring beads
