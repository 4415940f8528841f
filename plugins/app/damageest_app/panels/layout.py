"""What all steps share: the bar with job and run, the list of steps, the 3D view with its legend, keys."""

from __future__ import annotations

from typing import Any

from trame.ui.vuetify3 import VAppLayout
from trame.widgets import html
from trame.widgets import vtk as vtk_widgets
from trame.widgets import vuetify3 as v3

from damageest_app.panels.align import AlignPanel
from damageest_app.panels.judge import JudgePanel
from damageest_app.panels.marks import mark
from damageest_app.panels.open import OpenPanel
from damageest_app.panels.prepare import PreparePanel
from damageest_app.panels.repair import RepairPanel
from damageest_app.panels.several import SeveralPanel
from damageest_app.session import STEPS, Session
from damageest_app.view.pick import Ray

ICONS = ("mdi-folder-open-outline", "mdi-crop", "mdi-axis-arrow", "mdi-scale-balance", "mdi-layers-triple-outline",
         "mdi-table")  # fmt: skip
KEYS = (
    ("1 … 6", "go to a step"), ("r", "run"), ("Esc", "stop the run"), ("f", "see all"), ("n, p", "next, previous site"),
    ("a, d", "accept, drop the site"), ("Ctrl+Z, Ctrl+Y", "undo, redo"), ("j", "show the job file"), ("?", "this list"),
)  # fmt: skip


def build(session: Session) -> None:
    """Makes the page, and binds what happens on it."""
    panels: dict[str, Any] = {
        "open": OpenPanel(session),
        "prepare": PreparePanel(session),
        "align": AlignPanel(session),
        "judge": JudgePanel(session),
        "repair": RepairPanel(session),
        "several": SeveralPanel(session),
    }
    session.panels = panels
    session.state.update({"trame__title": "damageest", "show_keys": False, "show_stages": False})
    _bind(session)
    with VAppLayout(session.server, vuetify_config=_look()) as layout:
        layout.root.theme = ("dark ? 'dark' : 'light'",)
        _build_bar(session)
        with v3.VMain(style="height: 100vh"), html.Div(classes="shell"):
            _build_rail(session)
            with html.Div(classes="side"):
                _build_messages(session)
                for name in STEPS:
                    with html.Div(v_if=(f"step === '{name}'",)):
                        panels[name].build()
            _build_stage(session, panels["judge"])
        _build_dialogs()


def _look() -> dict[str, Any]:
    small = {"density": "compact", "hideDetails": True}
    field = {**small, "variant": "outlined"}
    kinds = {"VTextField": field, "VSelect": field, "VSlider": small, "VRangeSlider": small, "VSwitch": small}
    return {"defaults": {**kinds, "VBtnToggle": {"density": "compact"}, "VRadioGroup": small}}


def _build_bar(session: Session) -> None:
    with v3.VAppBar(density="compact", flat=True, border="b"):
        html.Div("damageest", classes="text-h6 ml-4 mr-4")
        html.Div("{{ job_name || 'no job is open' }}", classes="text-body-2 mr-2", raw_attrs=mark("job-name"))
        v3.VBtn(
            icon="mdi-file-code-outline",
            title="the job file (j)",
            click="show_job = !show_job",
            disabled=("!job_name",),
        )
        v3.VBtn(
            icon="mdi-undo",
            title="undo (Ctrl+Z)",
            click=session.step_back,
            disabled=("!can_undo || running",),
            raw_attrs=mark("undo"),
        )
        v3.VBtn(
            icon="mdi-redo",
            title="redo (Ctrl+Y)",
            click=(session.step_back, "[true]"),
            disabled=("!can_redo || running",),
            raw_attrs=mark("redo"),
        )
        v3.VChip(
            "the job was changed since this result",
            v_if=("stale && !running",),
            color="warning",
            size="small",
            classes="ml-2",
        )
        v3.VSpacer()
        with html.Div(v_if=("running",), style="width: 340px", classes="mr-4"):
            html.Div("{{ doing }} · {{ seconds }} s", classes="fine", raw_attrs=mark("doing"))
            v3.VProgressLinear(model_value=("100 * share",), color="primary", height=6, rounded=True)
        v3.VBtn(
            icon="mdi-format-list-checks",
            title="stages of the run",
            click="show_stages = !show_stages",
            disabled=("!stages.length",),
        )
        v3.VBtn(
            "Stop",
            v_if=("running",),
            color="error",
            variant="tonal",
            prepend_icon="mdi-stop",
            click=session.runs.stop,
            raw_attrs=mark("stop"),
        )
        v3.VBtn(
            "Run", v_if=("!running",), color="primary", variant="flat", prepend_icon="mdi-play", title="run the job (r)",
            click=session.runs.start, disabled=("!job_name || !!busy",), raw_attrs=mark("run"),
        )  # fmt: skip
        v3.VBtn(
            icon=("dark ? 'mdi-weather-sunny' : 'mdi-weather-night'",),
            title="dark or light",
            click="dark = !dark",
            raw_attrs=mark("dark"),
        )
        v3.VBtn(icon="mdi-keyboard-outline", title="keys (?)", click="show_keys = true")
        v3.VProgressLinear(active=("!!busy",), indeterminate=True, absolute=True, location="bottom", color="primary")


def _build_rail(session: Session) -> None:
    with v3.VNavigationDrawer(permanent=True, width=148), v3.VList(density="compact", nav=True):
        for name, icon in zip(STEPS, ICONS, strict=True):
            v3.VListItem(
                title=name.capitalize(), prepend_icon=icon, active=(f"step === '{name}'",), color="primary",
                click=(session.go, f"['{name}']"), raw_attrs=mark(f"step-{name}"),
            )  # fmt: skip


def _build_messages(session: Session) -> None:
    html.Div("{{ busy }} …", v_if=("busy",), classes="fine mb-2", raw_attrs=mark("busy"))
    with v3.VAlert(
        v_if=("message",), type=("tone",), variant="tonal", density="compact", closable=True, classes="mb-3",
        __events=[("close", "click:close")], close="message = ''", raw_attrs=mark("message"),
    ):  # fmt: skip
        html.Div("{{ message }}", classes="words")
        v3.VBtn(
            "Reload", v_if=("conflict",), size="small", classes="mt-2", click=session.reload, raw_attrs=mark("reload")
        )
    html.Div(
        "This folder cannot be written to, so no job can be made or changed here. Change its rights, or start the app "
        "with another folder.", v_if=("!writable",), classes="text-warning fine mb-2",
    )  # fmt: skip


def _build_stage(session: Session, judge: JudgePanel) -> None:
    with html.Div(classes="stage"):
        with html.Div(
            classes="view",
            raw_attrs=[
                '@pointerdown.capture="utils.damageest.press($event)"',
                '@click.capture="utils.damageest.click($event)"',
            ],
        ):
            view = vtk_widgets.VtkLocalView(session.scene.window, ref="view")
            session.ctrl.view_update = view.update
        with v3.VSheet(classes="legend", v_if=("legend.length",), elevation=2, raw_attrs=mark("legend")):
            with html.Div(v_for=("one in legend",), classes="row", key=("one.label",)):
                html.Div(classes="swatch", style=("{background: one.colour}",))
                html.Span("{{ one.label }}")
                html.Span("{{ one.value }}", classes="value")
        v3.VSheet("{{ hint }}", classes="hint", v_if=("hint",), elevation=2)
        judge.build_drawing()


def _build_dialogs() -> None:
    with v3.VNavigationDrawer(v_model=("show_job",), location="right", temporary=True, width=520):
        html.Div("{{ job_text }}", classes="yaml pa-4", raw_attrs=mark("job-text"))
    with (
        v3.VNavigationDrawer(v_model=("show_stages",), location="right", temporary=True, width=380),
        v3.VTable(density="compact"),
        html.Tbody(),
        html.Tr(v_for=("(one, k) in stages",), key=("k",)),
    ):
        html.Td("{{ one.name }}")
        html.Td("{{ one.cached ? 'from an earlier run' : one.seconds.toFixed(2) + ' s' }}", style="text-align: right")
    with (
        v3.VDialog(v_model=("show_keys",), width=420),
        v3.VCard(title="Keys"),
        v3.VTable(density="compact"),
        html.Tbody(),
    ):
        for keys, what in KEYS:
            with html.Tr():
                html.Td(keys, style="white-space: nowrap")
                html.Td(what)


def _bind(session: Session) -> None:
    state, ctrl = session.state, session.ctrl

    def set_dark(dark: bool, **_: Any) -> None:
        session.scene.set_dark(dark)
        session.push()

    state.change("dark")(set_dark)

    async def pick(click: dict[str, Any]) -> None:
        panel = session.panels.get(state.step)
        answer = panel.pick(Ray.of_click(click)) if panel else None
        if answer is not None:
            await answer

    async def key(name: str) -> None:
        if name in STEPS:
            session.go(name)
        elif name == "run":
            if not state.running:
                session.runs.start()
        elif name == "stop":
            session.runs.stop()
        elif name == "frame":
            session.push(session.scene.frame())
        elif name in ("undo", "redo"):
            await session.step_back(name == "redo")
        elif name == "job":
            state.show_job = not state.show_job
        elif name == "help":
            state.show_keys = True
        else:
            await session.panels["judge"].key(name)  # type: ignore[attr-defined]

    ctrl.trigger("pick")(pick)
    ctrl.trigger("key")(key)
    ctrl.trigger("refused")(lambda text: session.say(text, "error"))
    ctrl.on_server_ready.add(lambda **_: session.panels["open"].begin())  # type: ignore[attr-defined]
    ctrl.on_client_connected.add(lambda **_: session.panels["open"].look())
