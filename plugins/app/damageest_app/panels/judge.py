"""Judge: the sites with their verdicts, a section through each, and what a person decides."""

from __future__ import annotations

from typing import Any

import numpy as np
from trame.widgets import html
from trame.widgets import vuetify3 as v3

from damageest.io.colours import PART, SURPLUS, UNSEEN, colour_site
from damageest_app import edits
from damageest_app.panels.marks import mark
from damageest_app.session import Panel, Session
from damageest_app.view.pick import MeshPicker, Ray
from damageest_app.view.scene import Scene, lift, make_lines, make_mesh, make_points
from damageest_app.view.section import (
    HEIGHT,
    WIDTH,
    Cutter,
    Drawing,
    Plane,
    choose_plane,
    draw,
    measure_depth,
    to_space,
)

MOST_WARM = 20
"""Sites whose section is prepared before a click asks for it."""
STOPPED = [("click_stop", "click.stop")]
"""A click on a button of a card is no click on the card."""


class JudgePanel(Panel):
    """The list of sites, and the drawing of the section over the 3D view."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.plane: Plane | None = None
        self.drawing: Drawing | None = None
        self.measured: list[tuple[float, float]] = []
        self._cutters: dict[tuple[str, int], Cutter] = {}
        self.state.update(
            {"sites": [], "site": 0, "section": "", "section_axis": "auto", "section_offset": 0.0, "section_depth": 1.0,
             "layers": ["damage"], "hint_measure": "two clicks measure a distance"}
        )  # fmt: skip
        self.state.change("section_offset")(lambda **_: self._update_section())
        self.state.change("section_axis")(lambda **_: self._move_plane())
        self.state.change("layers")(lambda **_: session.redraw() if self.state.step == "judge" else None)

    def build(self) -> None:
        html.Div("Run the job: its sites are listed here.", v_if=("!has_result",))
        with html.Div(v_if=("has_result",)):
            html.Div("{{ one }}", v_for=("(one, k) in summary",), key=("k",), classes="text-body-2")
            html.Div("Sites", classes="head")
            html.Div("no damage was found", v_if=("!sites.length",))
            self._build_site()
            html.Div("Layers", classes="head")
            with v3.VBtnToggle(v_model=("layers",), multiple=True, color="primary", divided=True):
                for value, text in (
                    ("damage", "damage"),
                    ("points", "scan"),
                    ("unseen", "unseen"),
                    ("surplus", "surplus"),
                ):
                    v3.VBtn(text, value=value, size="x-small", raw_attrs=mark(f"layer-{value}"))
            with html.Div(v_if=("notes.length",)):
                html.Div("Notes of the run", classes="head")
                with html.Div(v_for=("(one, k) in notes",), key=("k",), classes="fine mb-1"):
                    html.Span("{{ one.text }}", classes="words")
                    html.Span(" → {{ one.remedy }}", v_if=("one.remedy",))

    def _build_site(self) -> None:
        with v3.VCard(
            v_for=("one in sites",), key=("one.id",), variant=("site === one.id ? 'tonal' : 'outlined'",), classes="mb-2 pa-2",
            click=(self.choose, "[one.id]"), raw_attrs=mark("site", 'tabindex="0"', '@keydown.enter="$event.currentTarget.click()"'),
        ):  # fmt: skip
            with html.Div(classes="d-flex align-center"):
                html.Span(classes="site-dot", style=("{background: one.colour}",))
                html.Span("site {{ one.id }}", classes="font-weight-medium mr-2")
                v3.VChip("{{ one.level }}", size="x-small", color=("one.tone",), prepend_icon=("one.icon",))
                v3.VChip(
                    "{{ one.choice === 'drop' ? 'dropped' : 'accepted' }}",
                    v_if=("one.choice",),
                    size="x-small",
                    classes="ml-1",
                )
                v3.VChip("one with {{ one.merged }}", v_if=("one.merged",), size="x-small", classes="ml-1")
            html.Div(
                "{{ one.volume }} {{ unit }}³ (95 %: {{ one.interval }}), depth {{ one.depth }} {{ unit }}, area {{ one.area }} {{ unit }}²",
                classes="fine",
            )
            with html.Div(v_if=("site === one.id",)):
                with html.Div(v_for=("(why, k) in one.reasons",), key=("k",), classes="fine mt-1"):
                    html.Div("{{ why.text }}", classes="words")
                    html.Div("→ {{ why.remedy }}", v_if=("why.remedy",))
                with html.Div(classes="d-flex mt-2", style="gap: 6px"):
                    v3.VBtn(
                        "accept",
                        size="small",
                        variant="tonal",
                        color="success",
                        raw_attrs=mark("accept"),
                        __events=STOPPED,
                        click_stop=(self.decide, "[one.id, 'accept']"),
                    )
                    v3.VBtn(
                        "drop",
                        size="small",
                        variant="tonal",
                        color="error",
                        raw_attrs=mark("drop"),
                        __events=STOPPED,
                        click_stop=(self.decide, "[one.id, 'drop']"),
                    )
                    v3.VBtn(
                        "by the criterion",
                        size="small",
                        variant="text",
                        v_if=("one.choice",),
                        __events=STOPPED,
                        click_stop=(self.decide, "[one.id, '']"),
                    )
                    v3.VSelect(
                        items=("sites.filter(x => x.id !== one.id).map(x => x.id)",), label="merge with", v_if=("sites.length > 1",),
                        update_modelValue=(self.merge, "[one.id, $event]"), style="max-width: 130px",
                        raw_attrs=mark("merge", '@click.stop=""'),
                    )  # fmt: skip

    def build_drawing(self) -> None:
        """The section, over the 3D view."""
        with v3.VSheet(classes="drawing", v_if=("step === 'judge' && section",), elevation=4):
            measure = "(at => at && trigger('measure', at))(utils.damageest.place($event))"
            html.Div(v_html=("section",), raw_attrs=mark("section", f'@click="{measure}"'))
            with html.Div(classes="d-flex align-center"):
                with v3.VBtnToggle(v_model=("section_axis",), mandatory=True, divided=True, classes="mr-3"):
                    for value in ("auto", "x", "y", "z"):
                        v3.VBtn(value, value=value, size="x-small", style="min-width: 34px")
                v3.VSlider(
                    v_model=("section_offset",), min=("-section_depth",), max=("section_depth",), step=("section_depth / 100",),
                    hide_details=True, raw_attrs=mark("section-offset"),
                )  # fmt: skip
            html.Div("{{ hint_measure }}", classes="fine")
        self.session.ctrl.trigger("measure")(self.measure)

    def choose(self, number: int) -> None:
        """A site was clicked: the camera goes there, a section goes through it."""
        results = self.session.results
        damage = results.read_solid("damage", number) if results else None
        if results is None or damage is None:
            self.state.site, self.state.section = number, ""
            return
        self.state.update({"site": number, "section_offset": 0.0, "section_axis": "auto"})
        self.measured = []
        self.plane = choose_plane(damage, results.output.read_surface(number))
        self.state.section_depth = measure_depth(damage, self.plane)
        direction = self.plane.up + 0.55 * self.plane.normal + 0.2 * self.plane.right
        camera = self.session.scene.look_at(damage.bounds.mean(axis=0), 2.2 * damage.diagonal, direction)
        self._update_section()
        self.session.push(camera)

    def _move_plane(self) -> None:
        results = self.session.results
        damage = results.read_solid("damage", int(self.state.site)) if results and self.state.site else None
        if results is None or damage is None:
            return
        self.plane = choose_plane(damage, results.output.read_surface(int(self.state.site)), self.state.section_axis)
        self.state.section_depth, self.measured = measure_depth(damage, self.plane), []
        self.state.section_offset = 0.0
        self._update_section()

    def _update_section(self) -> None:
        """Draws the section anew, and its outline in the 3D view."""
        results, number = self.session.results, int(self.state.site)
        if self.plane is None or results is None or not number:
            return
        plane = self.plane.shift(float(self.state.section_offset))
        loops = {
            name: cutter.cut(plane)
            for name in ("part", "damage", "deposit")
            if (cutter := self._find_cutter(name, number))
        }
        scan = results.output.scan
        spacing = max(float(results.content["scan"]["spacing"]), results.tolerance / 2)
        points = scan.points if scan is not None else np.empty((0, 3))
        colour = colour_site(number)
        self.drawing = draw(plane, loops, points, spacing, results.unit, colour, self.measured)
        self.state.section = self.drawing.svg
        lines = [line for name in ("part", "damage") for line in to_space(plane, loops.get(name, []))]
        self.session.scene.put("section", make_lines(lines), colour="#e0218a", size=2.5)
        if self.state.step == "judge":
            self.session.push()

    def _find_cutter(self, name: str, number: int) -> Cutter | None:
        """A body that is cut; prepared once."""
        results, inputs = self.session.results, self.session.inputs
        key = (name, 0 if name == "part" else number)
        if key not in self._cutters:
            if name == "part":
                body = inputs.part if inputs else None
            else:
                body = results.read_solid(name, number) if results else None
            if body is None:
                return None
            self._cutters[key] = Cutter(body)
        return self._cutters[key]

    def measure(self, x: float, y: float) -> None:
        """A click into the drawing, from 0 to 1: two of them measure a distance."""
        if self.drawing is None:
            return
        if len(self.measured) == 2:
            self.measured = []
        self.measured.append(self.drawing.to_plane(x * WIDTH, y * HEIGHT))
        self._update_section()
        if len(self.measured) == 2:
            (a, b), (c, d) = self.measured
            self.state.hint_measure = f"distance {np.hypot(c - a, d - b):.4g} {self.state.unit}"
        else:
            self.state.hint_measure = "a second click measures the distance"

    async def decide(self, number: int, choice: str) -> None:
        """Writes the choice into the job."""
        row = next((one for one in self.state.sites if one["id"] == number), None)
        if row is None:
            return
        if choice == "accept" and row["level"] != "doubtful" and row["choice"] != "drop":
            self.session.say(f"site {number} is {row['level']}, accepted without a line in the job", "info")
            return
        await self.session.apply(lambda tree: edits.choose_site(tree, number, choice, row["level"] == "doubtful"))

    async def merge(self, number: int, other: int) -> None:
        await self.session.apply(lambda tree: edits.merge_sites(tree, [number, int(other)]))

    async def key(self, name: str) -> None:
        """Keys of this step."""
        if self.state.step != "judge" or not self.state.sites:
            return
        numbers = [one["id"] for one in self.state.sites]
        here = numbers.index(self.state.site) if self.state.site in numbers else -1
        if name in ("next", "previous"):
            self.choose(numbers[(here + (1 if name == "next" else -1)) % len(numbers)])
        elif name in ("accept", "drop") and here >= 0:
            await self.decide(numbers[here], name)

    def read(self, values: dict[str, Any]) -> None:
        results = self.session.results
        self.state.sites = results.list_sites(values) if results else []

    def result(self) -> None:
        self._cutters, self.plane, self.measured = {}, None, []
        self.state.site, self.state.section = 0, ""

    def warm(self) -> None:
        results = self.session.results
        for number in results.output.site_numbers[:MOST_WARM] if results else ():
            damage = results.read_solid("damage", number) if results else None
            if results is None or damage is None:
                continue
            plane = choose_plane(damage, results.output.read_surface(number))
            for name in ("part", "damage", "deposit"):
                if cutter := self._find_cutter(name, number):
                    cutter.cut(plane)
            if results.output.scan is not None:
                draw(plane, {}, results.output.scan.points, results.tolerance, results.unit, "#000000")

    def draw(self, scene: Scene) -> None:
        inputs, results = self.session.inputs, self.session.results
        if inputs is None or results is None:
            self.state.hint = "run the job first" if self.state.job_name else "open a job first"
            return
        layers = self.state.layers
        body = results.read_solid("undamaged")
        scene.put("part", make_mesh(body if body is not None else inputs.part), colour=PART, opacity=0.4)
        over = 1e-3 * inputs.part.diagonal
        scan = results.output.scan
        if "points" in layers and scan is not None:
            scene.put("points", make_points(scan.points), colour="#5d6b78", size=1.5)
        if "damage" in layers:
            for number in results.output.site_numbers:
                solid = lift(results.read_solid("damage", number), over)
                scene.put(f"damage {number}", make_mesh(solid), colour=colour_site(number))
        if "unseen" in layers:
            scene.put("unseen", make_mesh(lift(results.output.read_mesh("unseen.ply"), over)), colour=UNSEEN)
        if "surplus" in layers:
            for one in results.content["surplus"]:
                scene.put(f"surplus {one['id']}", make_mesh(results.read_solid("surplus", one["id"])), colour=SURPLUS)
        if self.state.site and self.plane is not None:
            self._update_section()

    def pick(self, ray: Ray) -> Any:
        """A click on a damage in the 3D view chooses its site."""
        results = self.session.results
        if results is None:
            return
        found = []
        for number in results.output.site_numbers:
            solid = results.read_solid("damage", number)
            if solid is not None and (hit := MeshPicker(solid).find(ray)) is not None:
                found.append((float(np.linalg.norm(hit[0] - ray.origin)), number))
        if found:
            self.choose(min(found)[1])
