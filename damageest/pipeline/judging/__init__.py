"""The steps that say how exactly each site is known and what it is worth, up to the result."""

# collect.py: the step from the sites back to the job
# deposits.py: steps round the stage `allowance`: the other sites, sites that it refuses, and deposits that overlap
# paths.py: the step round the stage `path`: what is left of the part, and which sites are built up before
# sections.py: the step that cuts the sections that a job asks for
# scan_errors.py, weigh.py: the step about errors that all sites have in common; certificate and temperature
# sensor.py: the errors of the sensor, and the steps that dismiss what they explain
# uncertainty.py: steps that measure how exactly the volumes are known, of each site and in total
# verdicts.py: steps that judge the sites, and follow what a person decided about them in the job
