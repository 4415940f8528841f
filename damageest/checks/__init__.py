"""Can it be trusted: the quality of the scan, and what the scan says of each damage volume."""

# The modules:
# scan_quality.py: tolerance, noise, spacing
# skin_cells.py, coverage.py: skin that the scan shows
# shared_skin.py: points that an earlier scan can be compared with
# facing.py: points that face another way
# ray_evidence.py: what rays passed through
# evidence.py: damage volume against scan
# surplus.py: metal and bodies outside the skin
# model_fit.py, form_choice.py, form_fit.py, form_fields.py, form_words.py: bent part or scaled scan
# fit_doubts.py: conditions of "the part as designed explains the skin"
# view_split.py: views that the scan does not name
# view_fit.py, view_joint.py, view_overlap.py: agreement of views, their correction, what remains
# unseen_rim.py: loss that ends at the edge of the scan
# free_pose.py: effect of a free pose on a site
# dent.py: displaced metal that is not lost
# elsewhere.py: wide loss that may lie on other skin
# two_sheets.py, one_motion.py: two surfaces over the same skin; a misplaced view
# beyond_points.py: volume without points, points without volume
# scan_facts.py: deviating skin
# sensor.py, semivariogram.py: errors of the sensor, smallest visible loss, correlation of errors
# verdict.py: the criterion
# uncertainty.py, inner_surface.py, pose_error.py, fading.py: errors of a site
# site_error.py: 95 % intervals
# shallow_loss.py: largest loss where nothing is found
# visibility.py: could the remaining part have given this scan
# scanner.py: errors by certificate and temperature
# budget.py: the same as a table, JCGM 100
