"""Patterns of the texts by which a result or an error names a kind of trouble."""

from __future__ import annotations

NO_FIT = (r"points .{0,40}\b(lie|fit|are)\b.*(surface|part|tolerance)", r"no pose", r"another part", r"wrong part")
UNSEEN = (r"\bunseen\b", r"not (seen|scanned|covered)", r"no scan points?", r"without scan points", r"hidden")
LOST = (*UNSEEN, r"(may|can) be (lost|missing|gone)", r"(lost|gone|missing) altogether", r"passed? through")
SCALE = (r"\bscale", r"too (small|large)", r"\b(smaller|larger)\b than the part", r"\bunit\b")
BENT = (r"\bbent\b", r"\bbend", r"\btwist", r"deform", r"not rigid", r"form errors", r"form of the part")
VIEWS = (r"\bviews?\b.*(apart|misplaced|registered|disagree|differ|fit)", r"two layers", r"errors of scan")
NOISE = (
    r"scan's noise",
    r"tolerance .*(less|small|safe|below)",
    r"correlat",
    r"waviness",
    r"\bwav[ey]",
    r"\bsteps?\b",
    r"deviates .*from the part",
    r"errors of scan",
)
SURPLUS = (r"\bsurplus\b", r"added (metal|matter)", r"outside the (part|skin|nominal)", r"\bdeposit")
PIECE = (r"displaced piece", r"\bpieces?\b.*(moved|displaced|apart)")
CLUTTER = (r"surroundings", r"\btable\b", r"fixture", r"specimen", *SURPLUS)
STRAY = (r"\bstray\b", r"\boutliers?\b", r"isolated", r"points are needed", r"\bfew(er)? (scan )?points")
COARSE = (r"\bwalls?\b", r"\bthin(ner)?\b", r"thickness", r"tolerance .*(large|exceeds)")
SHALLOW = (r"shallow", r"(depth|deep).*tolerance", r"tolerance.*(depth|deep)")
SPARSE = (r"far more than the tolerance", r"too (sparse|few)", r"interpolated", r"points? .*apart")
FRAME = (*NO_FIT, r"\bpose\b", r"\bframe\b", r"systematic", r"shift")
