"""The rules: each one looks at the facts about a site and gives a reason, or none.

A rule is one doubt: a class in a file of its own, with its measure, thresholds, words and remedy. Plugins add rules by
the hook `damageest_rules`. The verdict follows from the reasons and from the interval of the volume. A term of that
interval is a class in a file as well; plugins add them by `damageest_terms`.
"""

from damageest.trust.doubt import RULE_FAILED, FreePose, Rule, ScanFacts, SiteCase, SiteFacts
from damageest.trust.interval.loss import LossCase
from damageest.trust.interval.site_error import Share, Term

__all__ = ["RULE_FAILED", "FreePose", "LossCase", "Rule", "ScanFacts", "Share", "SiteCase", "SiteFacts", "Term"]
