"""Can it be trusted: the quality of the scan, and what the scan says of each damage volume."""

# The rooms: doubts/ why doubt a site; terms/ sources of uncertainty; skin/ what the scan shows; form/ a bent part;
# views/ their agreement; interval/ how exactly.
# The modules:
# scan_quality.py: tolerance, noise, spacing
# scan_facts.py: deviating skin
# evidence.py: damage volume against scan
# surplus.py: metal and bodies outside the skin
# beyond_points.py: volume without points, points without volume
# model_fit.py: does the part as designed explain the skin
# fit_doubts.py: conditions of "the part as designed explains the skin"
# table.py: the classes of a room
# example.py: a small site for trying rules and terms
# doubt.py: what a doubt is, and the facts it sees
# verdict.py: what rules measure and say; the criterion
