"""The steps from damaged points to the volume of each site."""

# coverage.py: steps about what the scan shows of the skin
# fallback.py: method surface for what implicit fails on
# grouped_enclosure.py: the step for sites that bound a loss only together
# lost_bodies.py: bodies of the part that are gone altogether
# other_method.py: the volume of a site by the method that did not make it
# pores.py: closed cavities inside the metal
# sites.py: steps from the job to candidates for sites, and from their damage volumes to the sites
# surplus.py: steps for what lies outside the nominal surface
