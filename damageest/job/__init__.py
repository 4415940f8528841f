"""What to run: the job file, loaded and checked completely before anything is read or computed."""

# The modules:
# check.py: loads and checks a job
# beforehand.py: faults that would appear only after the work
# folders.py: folders of a scan's patches
# model.py, sections.py, scanner.py: fields of a job; sections; certificate and temperature
# length_error.py: formula of a certificate
# schema.py, reference.py: JSON Schema, job reference
# wording.py: messages
# yamlfile.py, yaml_limits.py: YAML with lines, its limits

from damageest.job.check import load
from damageest.job.model import Header, Job

__all__ = ["Header", "Job", "load"]
