"""What to do about a scan that is not as it should be, by topic: for `damageest explain` and docs/bad-scan.md.

Each topic has a word that stays the same from version to version, and the codes of the reasons that belong to it. A
refusal has the word of its topic as an attribute of the error.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from damageest.rules.notes import RUN_CODES
from damageest.trust.doubt import Rule
from damageest.trust.doubts import list_rules

if TYPE_CHECKING:
    from damageest.result import Result

MOST_NAMED = 3
"""Topics that the line at the end of a run names."""


@dataclass(frozen=True)
class Topic:
    """``word`` names it, ``title`` is its heading on the page. ``codes``: of the reasons that belong to it; rules name
    their topic themselves. ``text``: what to do. ``job``: lines of a job for it; empty where there are none."""

    word: str
    title: str
    codes: tuple[str, ...]
    text: str
    job: str = ""

    @property
    def page(self) -> str:
        """The section of the documentation with the same words, and an example."""
        words = "".join(mark for mark in self.title.lower() if mark.isalnum() or mark in " -")
        return f"docs/bad-scan.md#{words.replace(' ', '-')}"


ADVICE = (
    Topic(
        "unit",
        "The unit is wrong",
        ("unit",),
        "Look up the unit in the scanner's software, or measure one length of the part in the scan. Give that unit "
        "for the scan, not for the job: results stay in the unit of the CAD model. A tolerance that damageest init "
        "measured is wrong by the same factor: write the job again with --scan-unit, or take tolerance: auto.",
        "scan: {path: scan.ply, unit: m}",
    ),
    Topic(
        "surroundings",
        "Other things are in the scan",
        ("surroundings", "far_points", "filled_points"),
        "Cut off the table, clamps, markers and powder in the scanner's software or in the job. Crops are in the "
        "scan's own frame. What touches the part looks like added metal: cut it off by hand. Powder makes the part "
        "larger by its thickness: spray thinly, or clean the part.",
        "scan:\n"
        "  path: scan.ply\n"
        "  crop:\n"
        "    - {drop: above, point: [0, 0, -2], normal: [0, 0, -1]} # the table, below z = -2\n"
        "    - {keep: largest piece, gap: 3}",
    ),
    Topic(
        "pose",
        "The pose is not certain",
        ("align", "another_part", "other_poses", "pose_free", "mirrored", "given_pose"),
        "Open report.html and see whether the scan lies on the part. Scan faces in three directions, and features "
        "that break the symmetry, such as a keyway. On a symmetric part the volume is right in each pose, but the "
        "machine has to use the same one. Where the pose is wrong, pick three or more pairs of points, each first "
        "in the scan, then on the part. Where the scan is in the part's frame, take align: none.",
        "align: {use: points, pairs: [[[1, 2, 3], [41, 2, 3]], [[1, 52, 3], [41, 52, 3]], [[1, 2, 63], [41, 2, 63]]]}",
    ),
    Topic(
        "noise",
        "The noise is large for the tolerance",
        ("tolerance_small", "tolerance_raised", "below_noise", "depth_steps", "thin_walls"),
        "Take tolerance: auto, or four times the noise that the run prints. This scan cannot show a shallower "
        "loss: scan from nearer, with more exposures, or with a better scanner. Do not smooth the scan: that "
        "rounds the rims of the damage and hides the noise from the check.",
        "tolerance: auto",
    ),
    Topic(
        "sparse",
        "The points are too few",
        ("sparse_scan",),
        "Export the scan at full resolution, as points or as a mesh that was not decimated: only the vertices of a "
        "mesh are used. Three to five points should lie across the smallest damage that matters. Scan thin places "
        "again and give all files as a list.",
        "scan: {use: file, path: [view-1.ply, view-2.ply]}",
    ),
    Topic(
        "unseen",
        "The scan has holes and shadows",
        (),
        "Open unseen.ply over the CAD model, turn the part, and scan these places, above all into the damage and "
        "beside it. Give the position of the scanner for each view: rays then tell empty space from unseen space. "
        "Do not fill holes in the scanner's software: a filled hole looks like metal.",
        "scan:\n  - {path: view-1.ply, viewpoint: [0, -400, 350]}\n  - {path: view-2.ply, viewpoint: [0, 400, 350]}",
    ),
    Topic(
        "views",
        "The views do not fit together",
        (),
        "Register the views to each other again. Or give each view as its own file with the position of its "
        "scanner: align: register then corrects each view that fixes its own pose. Views in one file are told "
        "apart only where they follow each other in it. To find the wrong view, run each alone.",
        "scan:\n"
        "  - {path: view-1.ply, viewpoint: [0, -400, 350]}\n"
        "  - {path: view-2.ply, viewpoint: [0, 400, 350]}\n"
        "align: {use: register, fit_views: true}",
    ),
    Topic(
        "stray",
        "Points lie where nothing is",
        ("speck", "low_confidence"),
        "Remove stray points and points at edges by the filters of the scanner's software. Where the file has a "
        "confidence, points below a value can be set aside. Compare with a run without the limit: points in a "
        "damage often have the least confidence.",
        "scan: {path: scan.ply, min_confidence: 0.3}",
    ),
    Topic(
        "form",
        "The part is bent, or the scan is scaled",
        ("model_fit", "adapt"),
        "Measure one length of the part and compare it with the scan. If the scan is wrong, correct its scale. If "
        "the part is bent or twisted, adapt: auto, the default, bends the CAD model until it follows the intact "
        "skin. Colour scan.ply by distance: the rest should be even noise, without bands.",
        "scan: {path: scan.ply, scale: auto}\nadapt: auto",
    ),
    Topic(
        "wear",
        "A whole face is worn",
        (),
        "Name unworn faces, such as journals, a foot or end faces: only they fix the pose then. `damageest faces` "
        "lists the faces of a STEP file. Where a fixture gives the pose, take align: none.",
        "align:\n  use: register\n  datum: [{facing: {direction: [0, 0, -1], angle: 5}}]",
    ),
    Topic(
        "surplus",
        "Metal or dirt lies on the part",
        ("displaced_piece", "surplus"),
        "Remove weld beads, spatter or dirt from the damage, and scan again: a loss below them cannot be seen. A "
        "displaced piece is no loss: put it back, or accept the site to repair it as if the piece were lost. "
        "Surplus elsewhere changes no volume.",
        "accept: [1]",
    ),
    Topic(
        "doubtful",
        "A site is doubtful, or its interval is wide",
        (),
        "Read its reasons in the report and look at the place on the part. If the metal is missing there, accept "
        "the site by its number; if not, drop it. A better scan of this place makes the interval narrower. A "
        "larger tolerance removes shallow sites that are errors of the scan.",
        "accept: [3, 5] # these doubtful sites beside the likely ones\nsites: {drop: [2]}",
    ),
)


def make_topics(rules: Iterable[Rule | type[Rule]]) -> tuple[Topic, ...]:
    """The topics with the codes of the rules that belong to them."""
    codes = [(rule.topic, rule.code) for rule in rules]
    return tuple(
        replace(one, codes=(*one.codes, *(code for word, code in codes if word == one.word))) for one in ADVICE
    )


TOPICS = make_topics(list_rules())


def find_topic(word: str) -> Topic | None:
    """The topic of this word, or the one that a code belongs to; None where there is none."""
    named = next((topic for topic in TOPICS if topic.word == word), None)
    return named or next((topic for topic in TOPICS if word in topic.codes), None)


def name_topics(codes: Iterable[str]) -> list[str]:
    """The words of the topics of some codes, each once, at most `MOST_NAMED`, in the order of the codes; that a site is
    doubtful stands last, since the others say why."""
    words = dict.fromkeys(topic.word for topic in map(find_topic, codes) if topic)
    return sorted(words, key=lambda word: word == "doubtful")[:MOST_NAMED]


def list_topics(result: Result) -> list[str]:
    """The words of the topics that a run has doubts about: those of doubtful sites first, then of notes that may change
    a decision, then of the other sites and notes."""
    doubtful: list[str] = []
    others: list[str] = []
    for site in result.sites:
        codes = doubtful if site.verdict.level == "doubtful" else others
        codes += [reason.code for reason in site.verdict.reasons]
    notes = [note.code for note in result.warnings]
    if result.fit is not None and result.fit.model == "views disagree":  # the same code says that a part is bent
        notes = ["two_sheets" if code == "model_fit" else code for code in notes]
    first = [code for code in notes if (code in RUN_CODES and RUN_CODES[code].rank == 0) or code == "two_sheets"]
    return name_topics([*doubtful, *first, *others, *notes])
