"""The steps that read, place and correct the scan, up to the distance of each point."""

# adapt.py: the step that puts the adapted part in the place of the part as designed
# alignment.py: the step that finds the pose, also that of a part that is no longer as designed
# datums.py: what lies on the job's datums, and whether these still hold a pose after the scan was moved
# form.py: steps about parts and scans that one rigid pose does not explain
# large_scans.py: scans of which the reader gives only some points
# prepare.py: steps between reading the inputs and finding damage
# temperature.py: the step about the temperature of the part
# selections.py: checks what a job says of the part's skin and CAD faces as soon as the part is read
# shared.py: what can be compared, where an earlier scan stands for the part
# shared_table.py: whether an earlier and a later scan were laid on each other by a table that both show
