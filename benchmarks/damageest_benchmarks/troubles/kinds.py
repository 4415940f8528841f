"""The kinds of trouble, and the cases of each."""

from __future__ import annotations

from damageest_benchmarks.troubles import clutter, frame, lost, scanner, shape, wear
from damageest_benchmarks.troubles.form import FORM_TROUBLES
from damageest_benchmarks.troubles.ways import (
    Trouble,
    TroubleWay,
    scan_from_few,
    scan_partly,
    spread_amounts,
    spread_over,
)

TROUBLES: dict[str, Trouble] = {
    "ordinary damage": Trouble(
        lost.take_damage,
        (
            TroubleWay("gear", "unknown", 0, amount=0),
            TroubleWay("block", "known", 8, amount=1),
            TroubleWay("lever", "unknown", 8, amount=2),
            TroubleWay("keyed_shaft", "unknown", 0, amount=3),
            TroubleWay("coupling", "known", 3, amount=0),
            TroubleWay("cylinder", "unknown", 0, amount=4),
            TroubleWay("grille", "unknown", 8, amount=5),
        ),
    ),
    "undamaged part, full scan": Trouble(
        scanner.scan_intact, spread_over("block half_torus shaft plate", "both", views=0)
    ),
    "lost wall": Trouble(
        lost.lose_wall,
        tuple(TroubleWay("wall_plate", "known", 8, positions, k) for k in (1, 2, 3, 4) for positions in (True, False)),
    ),
    "bite out of a thin wall": Trouble(
        lost.bite_wall,
        (
            TroubleWay("wall_plate", "known", 8, True, 3),
            TroubleWay("wall_plate", "known", 8, False, 3),
            TroubleWay("wall_plate", "unknown", 0, False, 3),
        ),
    ),
    "lost rib": Trouble(
        lost.lose_rib,
        (*spread_over("rib_bracket ribbed_plate", "both"), TroubleWay("rib_bracket", "known", 8, False)),
    ),
    "lost pin": Trouble(
        lost.lose_pin, (*spread_over("pin_plate grille", "both"), TroubleWay("pin_plate", "unknown", 8, False))
    ),
    "lost body": Trouble(
        lost.lose_body,
        (
            TroubleWay("two_blocks", "known", 8),
            TroubleWay("two_blocks", "unknown", 8),
            TroubleWay("two_blocks", "known", 8, False),
            TroubleWay("two_blocks", "unknown", 3, False, 1),
        ),
    ),
    "damage on the side not scanned": Trouble(
        lost.hide_damage,
        (
            TroubleWay("block", "known", 3),
            TroubleWay("cuboid", "unknown", 3),
            TroubleWay("tube", "known", 1, False),
            TroubleWay("lever", "unknown", 3, False),
        ),
    ),
    "undamaged part, partial scan": Trouble(scanner.scan_intact, scan_partly()),
    "undamaged part, depth in steps": Trouble(
        scanner.scan_in_steps,
        (
            TroubleWay("block", "known", 1, amount=1.0),
            TroubleWay("lever", "unknown", 3, amount=1.0),
            TroubleWay("tube", "known", 8, amount=1.0),
        ),
    ),
    "skin beside the damage not scanned": Trouble(
        lost.shade_damage,
        (
            TroubleWay("block", "known", 0, False, 0),
            TroubleWay("cuboid", "known", 8, True, 0.4),
            TroubleWay("lever", "unknown", 0, False, 0.4),
        ),
    ),
    "deep hole, bottom not seen": Trouble(
        lost.lose_deep_hole,
        (TroubleWay("cuboid", "known", 8), TroubleWay("plate", "unknown", 8), TroubleWay("cuboid", "known", 8, False)),
    ),
    "scale wrong": Trouble(
        shape.scale_scan,
        (
            TroubleWay("block", "unknown", 8, amount=0.995),
            TroubleWay("lever", "unknown", 0, False, 1.005),
            TroubleWay("gear", "known", 8, amount=1.005),
        ),
    ),
    "part bent": Trouble(
        shape.bend_part,
        (TroubleWay("plate", "unknown", 0, False, 0.01), TroubleWay("lever", "known", 8, amount=0.01)),
    ),
    "blade twisted": Trouble(
        shape.twist_part,
        (TroubleWay("blade", "unknown", 0, False, 2.0), TroubleWay("blade", "known", 8, amount=2.0)),
    ),
    "view misplaced": Trouble(
        scanner.misplace_view,
        (
            TroubleWay("block", "unknown", 8, amount=3),
            TroubleWay("tube", "known", 8, amount=5),
            TroubleWay("lever", "unknown", 3, amount=3),
        ),
    ),
    "waviness": Trouble(
        scanner.make_wavy,
        (TroubleWay("block", "known", 8, amount=1), TroubleWay("gear", "unknown", 0, False, 1.5)),
    ),
    "worn face": Trouble(
        lost.wear_face,
        (
            TroubleWay("plate", "known", 8, amount=2),
            TroubleWay("plate", "unknown", 8, amount=2),
            TroubleWay("cuboid", "unknown", 0, False, 2),
            TroubleWay("block", "known", 0, False, 2),
        ),
    ),
    "crack, both pieces scanned": Trouble(
        lost.crack,
        (TroubleWay("cuboid", "known", 8, amount=1.0), TroubleWay("lever", "unknown", 0, False, 1.5)),
    ),
    "wrong part": Trouble(
        frame.scan_other_part,
        (
            TroubleWay("block", "known", 8, amount=0),
            TroubleWay("gear", "unknown", 0, False, 0),
            TroubleWay("cylinder", "unknown", 8, amount=1),
            TroubleWay("ribbed_plate", "known", 8, amount=4),
        ),
    ),
    "mirrored part": Trouble(
        frame.scan_mirrored_part,
        (
            TroubleWay("block", "unknown", 0, False),
            TroubleWay("ribbed_plate", "unknown", 8),
            TroubleWay("block", "known", 8),
        ),
    ),
    "wrong frame": Trouble(
        frame.shift_frame,
        (
            TroubleWay("block", "known", 8, amount=1.0),
            TroubleWay("gear", "known", 8, amount=1.0),
            TroubleWay("block", "known", 0, False, 400.0),
            TroubleWay("lever", "known", 8, amount=60.0),
        ),
    ),
    "wrong unit": Trouble(
        frame.change_unit,
        (
            TroubleWay("block", "unknown", 0, False, 0.1),
            TroubleWay("gear", "known", 8, amount=0.001),
            TroubleWay("lever", "unknown", 8, amount=1 / 25.4),
        ),
    ),
    "stray cluster": Trouble(
        clutter.add_cluster, tuple(TroubleWay("plate", "known", 0, False, k) for k in (4, 16, 30))
    ),
    "stray cluster and damage": Trouble(
        clutter.add_cluster_beside_damage,
        (
            TroubleWay("plate", "known", 8, amount=4),
            TroubleWay("block", "unknown", 8, amount=16),
            TroubleWay("plate", "known", 0, False, 30),
        ),
    ),
    "narrow groove": Trouble(
        lost.cut_narrow_groove,
        (TroubleWay("plate", "known", 8, amount=1.5), TroubleWay("cuboid", "unknown", 0, False, 1.5)),
    ),
    "weld bead": Trouble(
        shape.weld_bead,
        (
            TroubleWay("cuboid", "known", 8, amount=0),
            TroubleWay("plate", "unknown", 8, amount=1),
            TroubleWay("cylinder", "known", 8, amount=2),
            TroubleWay("cuboid", "unknown", 0, False, 2),
        ),
    ),
    "table or fixture": Trouble(
        clutter.leave_table,
        (
            TroubleWay("block", "unknown", 3),
            TroubleWay("cuboid", "known", 3, False, 1),
            TroubleWay("lever", "known", 3, amount=1),
        ),
    ),
    "second specimen": Trouble(
        clutter.add_specimen, (TroubleWay("block", "known", 8), TroubleWay("lever", "unknown", 8))
    ),
    "mixed pixels": Trouble(
        scanner.mix_pixels,
        (TroubleWay("block", "known", 8, amount=0.02), TroubleWay("coupling", "unknown", 3, amount=0.04)),
    ),
    "outliers": Trouble(
        scanner.add_outliers,
        (TroubleWay("gear", "unknown", 0, False, 0.02), TroubleWay("plate", "known", 8, amount=0.05)),
    ),
    "uneven density": Trouble(
        scanner.vary_density,
        (TroubleWay("tube", "unknown", 0, False, 10), TroubleWay("block", "known", 8, amount=10)),
    ),
    "few points": Trouble(
        scanner.scan_sparsely,
        (TroubleWay("cuboid", "known", 8, amount=3000), TroubleWay("gear", "unknown", 0, False, 6000)),
    ),
    "noise larger than said": Trouble(
        scanner.make_noisier,
        (TroubleWay("block", "known", 8, amount=3), TroubleWay("lever", "unknown", 0, False, 3)),
    ),
    "tolerance too large for the walls": Trouble(
        scanner.widen_tolerance,
        (TroubleWay("wall_plate", "known", 8, amount=1.5), TroubleWay("ribbed_plate", "known", 8, False, 2.0)),
    ),
    "shallow pit": Trouble(
        lost.make_shallow_pit,
        (
            TroubleWay("cuboid", "known", 8, amount=1.5),
            TroubleWay("block", "unknown", 0, False, 2.0),
            TroubleWay("plate", "known", 0, False, 1.5),
        ),
    ),
    "thin wall between losses": Trouble(
        lost.leave_thin_wall,
        (TroubleWay("plate", "known", 8, amount=0.6), TroubleWay("cuboid", "unknown", 0, False, 0.6)),
    ),
    "undamaged part, few positions": Trouble(scanner.scan_intact, scan_from_few()),
    "undamaged part, few positions, depth in steps": Trouble(scanner.scan_in_steps, scan_from_few(1.0)),
    **FORM_TROUBLES,
    **wear.WEAR_TROUBLES,
    "second view too deep, views not given": Trouble(
        scanner.lay_sheets,
        (
            *spread_amounts("rib_bracket block lever ribbed_plate cuboid plate gear coupling tube", (1.5, 2.5)),
            TroubleWay("rib_bracket", "known", 3, False, 1.2),
            TroubleWay("rib_bracket", "known", 8, False, 1.5),
        ),
    ),
    "waves inward only": Trouble(
        scanner.make_hollow,
        (
            TroubleWay("plate", "known", 0, False, 1.5),
            TroubleWay("block", "known", 0, False, 2.0),
            TroubleWay("lever", "unknown", 0, False, 2.0),
            TroubleWay("cuboid", "known", 0, False, 3.0),
        ),
    ),
}
"""Name of a kind: what makes it, and its cases."""
