"""How exactly volume and depth of a site are known: errors, 95 % intervals, budget."""

# loss.py, inner_surface.py, pose_error.py: what terms have in common
# uncertainty.py, fading.py: errors of a site
# free_pose.py: effect of a free pose on a site
# site_error.py: what a term is, and how terms add up: 95 % intervals
# shallow_loss.py: largest loss where nothing is found
# sensor.py, semivariogram.py: errors of the sensor, smallest visible loss, correlation of errors
# scanner.py: errors by certificate and temperature
# budget.py: the same as a table, JCGM 100
