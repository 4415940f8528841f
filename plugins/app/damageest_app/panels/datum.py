"""The datum: unworn faces that fix the pose, together or one after the other."""

from __future__ import annotations

from typing import Any

from trame.widgets import html
from trame.widgets import vuetify3 as v3

from damageest_app import edits
from damageest_app.panels.marks import mark
from damageest_app.panels.shown import put_faces
from damageest_app.session import Panel, Session
from damageest_app.view.pick import Ray
from damageest_app.view.scene import Scene

COLOURS = ("#2fa84f", "#2f86d6", "#e0902f")
"""Of the datums by their precedence."""
LETTERS = "ABC"
TOGETHER = "together"


class DatumTool(Panel):
    """Part of the step Align."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.datums: dict[str, list[Any]] = {}
        self.state.update({"datum_rows": [], "datum_slots": [TOGETHER, "A"], "datum_slot": TOGETHER})

    def build(self) -> None:
        html.Div(
            "Click unworn faces: they fix the pose. Together, or "
            "in order: A, then B, then C (3-2-1). A second click removes a face.",
            classes="fine mb-2",
        )
        with v3.VBtnToggle(v_model=("datum_slot",), mandatory=True, divided=True, color="primary", classes="mb-2"):
            v3.VBtn(
                "{{ one }}", v_for=("one in datum_slots",), key=("one",), value=("one",), size="small",
                raw_attrs=mark("datum-slot"),
            )  # fmt: skip
        with html.Div(
            v_for=("(one, k) in datum_rows",), key=("k",), classes="text-body-2", raw_attrs=mark("datum-row")
        ):
            html.Span(classes="site-dot", style=("{background: one.colour}",))
            html.Span("{{ one.text }}")
        html.Div("no datum: all of the skin is used", v_if=("!datum_rows.length",), classes="fine")

    def read(self, values: dict[str, Any]) -> None:
        align, tools = values.get("align"), self.session.find_tools()
        self.datums = edits.list_datums(align.get("datum") if isinstance(align, dict) else None)
        rows = []
        for (letter, faces), colour in zip(self.datums.items(), COLOURS, strict=False):
            for face in faces:
                words = tools[1].describe(face) if tools else str(face)
                rows.append({"colour": colour, "text": f"{letter}: {words}" if letter else words})
        self.state.datum_rows = rows
        there = [letter for letter in self.datums if letter] or (["A"] if self.datums else [])
        free = [letter for letter in LETTERS if letter not in there]
        self.state.datum_slots = [TOGETHER, *there, *free[: 1 if len(there) < len(LETTERS) else 0]]
        if self.state.datum_slot not in self.state.datum_slots:
            self.state.datum_slot = TOGETHER

    def draw(self, scene: Scene) -> None:
        if tools := self.session.find_tools():
            shown = zip(self.datums.values(), COLOURS, strict=False)
            put_faces(scene, tools[1], [(face, colour) for faces, colour in shown for face in faces])

    async def pick(self, ray: Ray) -> None:
        tools = self.session.find_tools()
        hit = tools[0].find(ray) if tools else None
        if tools is None or hit is None:
            return
        there = [one for faces in self.datums.values() for one in faces if tools[1].match(one)[hit[1]]]
        face = there[0] if there else tools[1].select(hit[1])
        letter = "" if self.state.datum_slot == TOGETHER else str(self.state.datum_slot)
        if await self.session.apply(lambda tree: edits.toggle_datum(tree, face, letter)):
            self.session.redraw()
