"""Several: the jobs of the folder as a table, with what each run found."""

from __future__ import annotations

from trame.widgets import html
from trame.widgets import vuetify3 as v3

from damageest_app.panels.marks import mark
from damageest_app.session import Panel, Session
from damageest_app.view.scene import Scene


class SeveralPanel(Panel):
    """A row for each job; a click opens it."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.state.update({"rows": [], "only_doubtful": False})

    def build(self) -> None:
        with html.Div(classes="d-flex align-center mb-2", style="gap: 8px"):
            v3.VSwitch(
                v_model=("only_doubtful",),
                label="doubtful ones",
                color="primary",
                hide_details=True,
                raw_attrs=mark("only-doubtful"),
            )
            v3.VBtn(
                "next",
                size="small",
                variant="tonal",
                click=(self.open_next, "[only_doubtful]"),
                raw_attrs=mark("next-job"),
            )
            v3.VBtn("look again", size="small", variant="text", click=self.look, raw_attrs=mark("look"))
        with v3.VCard(
            v_for=("one in rows.filter(x => !only_doubtful || x.state === 'doubtful')",), key=("one.job",), classes="mb-2 pa-2",
            variant=("one.job === job_name ? 'tonal' : 'outlined'",), click=(self.open_job, "[one.job]"), raw_attrs=mark("job-row"),
        ):  # fmt: skip
            with html.Div(classes="d-flex align-center"):
                html.Span("{{ one.job }}", classes="font-weight-medium mr-2")
                v3.VChip("{{ one.state }}", size="x-small", color=("one.tone",))
            html.Div(
                "{{ one.volume }}, 95 %: {{ one.interval }}; proven {{ one.proven }}, likely {{ one.likely }}, doubtful {{ one.doubtful }}",
                v_if=("one.volume",),
                classes="fine",
            )
        v3.VBtn(
            "run all not yet run", size="small", color="primary", variant="tonal", click=self.start_all,
            disabled=("running || !rows.some(x => x.state === 'not run')",), raw_attrs=mark("run-all"),
        )  # fmt: skip

    def look(self) -> None:
        self.state.rows = self.session.folder.list_jobs()

    async def open_job(self, name: str) -> None:
        await self.session.open_job(name)
        self.session.go("judge" if self.session.results is not None else "open")

    async def open_next(self, only_doubtful: bool) -> None:
        """Opens the next job of the list, or of the doubtful ones."""
        self.look()
        names = [row["job"] for row in self.state.rows if not only_doubtful or row["state"] == "doubtful"]
        if not names:
            self.session.say("there is no such job", "info")
            return
        here = names.index(self.state.job_name) if self.state.job_name in names else -1
        await self.session.open_job(names[(here + 1) % len(names)])
        self.session.redraw(frame=True)

    def start_all(self) -> None:
        self.session.spawn(self.run_all())

    async def run_all(self) -> None:
        """Runs the jobs without a result, one after the other; Stop ends the row of them."""
        session = self.session
        self.look()
        for row in list(self.state.rows):
            if row["state"] == "not run":
                await session.open_job(row["job"])
                await session.runs.run(then="several")
                if session.runs.was_stopped:
                    break
        self.look()

    def result(self) -> None:
        if self.state.step == "several":
            self.look()

    def draw(self, scene: Scene) -> None:
        self.look()
        self.session.panels["judge"].draw(scene)  # the sites of the open job
