"""Open: which part and which scan, in which unit, and the job that is made of them."""

from __future__ import annotations

import asyncio
from typing import Any

import numpy as np
from trame.widgets import html
from trame.widgets import vuetify3 as v3

from damageest.io.colours import PART
from damageest_app import edits
from damageest_app.folder import guess_inputs
from damageest_app.inputs import UNITS
from damageest_app.panels.marks import mark
from damageest_app.panels.shown import place_beside, put_scan
from damageest_app.session import Panel, Session
from damageest_app.view.scene import Scene, make_mesh


class OpenPanel(Panel):
    """Lists what the folder has, makes a job as `damageest init` does, and shows its inputs."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.state.update(
            {"files": session.folder.list_files(), "new_part": None, "new_scan": None, "new_unit": "mm", "apart": True,
             "part_facts": "", "scan_facts": "", "unit_doubt": "", "unit_offers": []}
        )  # fmt: skip
        self.state.change("apart")(lambda **_: session.redraw(frame=True) if self.state.step == "open" else None)

    def begin(self) -> None:
        """The server is up: a folder with one job opens it."""
        jobs = self.state.files["jobs"]
        if len(jobs) == 1:
            self._opening = asyncio.ensure_future(self._open_first(jobs[0]))  # kept, or it may end early

    def look(self) -> None:
        """A tab was opened or loaded again: the folder may have other files."""
        with self.state:
            self.state.files = self.session.folder.list_files()
            part, scan = guess_inputs(self.state.files)
            self.state.new_part, self.state.new_scan = self.state.new_part or part, self.state.new_scan or scan

    async def _open_first(self, name: str) -> None:
        await self.session.open_job(name)
        self.state.flush()

    def build(self) -> None:
        session = self.session
        with v3.VAlert(
            v_if=("has_inputs && unit_doubt",),
            type="warning",
            variant="tonal",
            density="compact",
            classes="mb-3",
            raw_attrs=mark("unit-doubt"),
        ):
            html.Div("{{ unit_doubt }}", classes="words fine")
            v3.VBtn(
                "the {{ one.of }} is in {{ one.words }}", v_for=("one in unit_offers",), key=("one.of + one.unit",),
                size="small", classes="mt-2 mr-2", click=(self.set_unit, "[one.of, one.unit]"), raw_attrs=mark("unit-offer"),
            )  # fmt: skip
        html.Div("A job of this folder", classes="head", v_if=("files.jobs.length",))
        v3.VSelect(
            items=("files.jobs",), model_value=("job_name",), update_modelValue=(session.open_job, "[$event]"),
            label="job", v_if=("files.jobs.length",), raw_attrs=mark("job"),
        )  # fmt: skip
        html.Div("A new job", classes="head")
        v3.VSelect(
            v_model=("new_part",),
            items=("files.parts",),
            label="part as designed (CAD)",
            classes="mb-3",
            raw_attrs=mark("part"),
        )
        v3.VSelect(
            v_model=("new_scan",),
            items=("files.scans",),
            label="scan of the damaged part",
            classes="mb-3",
            raw_attrs=mark("scan"),
        )
        with html.Div(classes="d-flex align-center"):
            v3.VSelect(
                v_model=("new_unit",),
                items=("units", list(UNITS)),
                label="unit of files without a unit",
                classes="mr-3",
            )
            v3.VBtn(
                "Open",
                color="primary",
                variant="tonal",
                click=self.make_job,
                disabled=("!new_part || !new_scan || !!busy || !writable",),
                raw_attrs=mark("make"),
            )
        html.Div("Or drop files on this page: they are copied to {{ folder }}.", classes="fine mt-3")
        with html.Div(v_if=("has_inputs",)):
            html.Div("Part", classes="head")
            html.Div("{{ part_facts }}", classes="text-body-2", raw_attrs=mark("part-facts"))
            html.Div("Scan", classes="head")
            html.Div("{{ scan_facts }}", classes="text-body-2", raw_attrs=mark("scan-facts"))
            v3.VSwitch(v_model=("apart",), label="side by side", color="primary", hide_details=True, classes="mt-2")
            html.Div(
                "Next: Run finds the pose and the damage. Prepare crops a scan that shows more than the part.",
                v_if=("!has_result && !unit_doubt",),
                classes="text-primary mt-2",
            )

    async def make_job(self) -> None:
        """Writes the job file with `damageest init`, and opens it."""
        session, state = self.session, self.state
        folder = session.folder
        try:
            for name in (state.new_part, state.new_scan):
                folder.find(name)
        except Exception as error:
            session.say(str(error), "error")
            return
        name = folder.new_job(state.new_part)
        words = ["init", state.new_part, state.new_scan, "--job", name, "--units", state.new_unit]
        outcome = await session.work("measuring part and scan", session.runs.runner.call, words, folder.path)
        if outcome is None:
            return
        if outcome.status or not (folder.path / name).is_file():
            session.say(outcome.messages or "the job could not be made", "error")
            return
        state.files = folder.list_files()
        await session.open_job(name)
        if outcome.messages and not state.message and not state.unit_doubt:  # the page has the unit already
            session.say(outcome.messages, "warning")

    async def set_unit(self, of: str, unit: str) -> None:
        if await self.session.apply(lambda tree: edits.set_unit(tree, of, unit), reads=True):
            self.session.say(f"the {of} is read in {UNITS[unit]}; the tolerance is auto again", "success")
        self.session.push(self.session.scene.frame())

    def read(self, values: dict[str, Any]) -> None:
        inputs = self.session.inputs
        if inputs is not None:
            self.state.part_facts, self.state.scan_facts = inputs.describe_part(), inputs.describe_scan()
            self.state.unit_doubt = inputs.doubt
            self.state.unit_offers = [{"of": of, "unit": unit, "words": UNITS[unit]} for of, unit in inputs.offers]

    def draw(self, scene: Scene) -> None:
        inputs = self.session.inputs
        if inputs is None:
            self.state.hint = "pick a part and its scan" if not self.state.job_name else ""
            return
        scene.put("part", make_mesh(inputs.part), colour=PART, opacity=1.0 if self.state.apart else 0.45)
        offset = place_beside(inputs.part.bounds, inputs.scan.points) if self.state.apart else np.zeros(3)
        put_scan(scene, inputs, offset)
