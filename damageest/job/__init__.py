"""What to run: the job file, loaded and checked completely before anything is read or computed."""

from damageest.job.check import load
from damageest.job.model import Header, Job

__all__ = ["Header", "Job", "load"]
