"""A drive from its data sheet: a form of what plates and drawings say, and the drive that follows."""

from __future__ import annotations

from collections.abc import Hashable

from nicegui import ui

from softstart.drive.data_sheet import DataSheet
from softstart.drive.data_sheet_words import (
    ABOUT,
    MACHINES,
    TYPICAL,
    USUAL,
    answered,
    echo,
    if_empty,
    in_usual_unit,
    typed,
)
from softstart.errors import InputError
from softstart.input.parameters import Parameter
from softstart.page.downloads import drive_file
from softstart.page.panel_parts import (
    Troubles,
    action,
    box,
    choice,
    hint,
    notify,
    reveal,
    row_of,
    save,
    text_field,
)
from softstart.page.sentences import in_words
from softstart.page.session import Session
from softstart.quantities import RefusedError
from softstart.views.numbers import cut
from softstart.views.numbers import unit as printed

TITLES = {
    "load": "Machine",
    "motor": "Motor, from its plate",
    "coupling": "Coupling on the motor shaft",
    "gear": "Gearbox",
    "output": "Behind the gearbox",
    "rope": "Rope",
    "shaft": "Damping",
    "limits": "Permissible torque",
}
LABELS = {p.path: p.meaning for p in DataSheet.PARAMETERS.values()}


class DataSheetPanel:
    """The form, what is wrong with it, and what follows from it; built in the current slot."""

    def __init__(self, session: Session, user: Hashable) -> None:
        self._session = session
        self._fields: dict[str, ui.input | ui.select] = {}
        with box("sheet-form"):
            hint(
                "Each number as its data sheet gives it, at its own part, in the unit beside its name or "
                "another one. What is not known stays empty: below it stands what is used then; * is needed."
            )
            tables = {table.name: table.parameters for table in DataSheet.TABLES}
            tables[""] = tuple(p for p in tables[""] if p.name != "units")  # those of the page
            for name, title in {"": "", **TITLES}.items():
                if title:
                    ui.html(title, tag="h3", sanitize=False).classes("panel-title")
                with box("panel-form"):
                    for p in tables[name]:
                        self._fields[p.name] = data_sheet_field(p)
        machine = self._fields["machine"]
        machine.on_value_change(lambda event: self._about(str(event.value)))
        self._about(str(machine.value))
        with box("sheet-answer") as self._answer:
            with box("panel-actions"):
                action("Use this drive", self._use, "sheet-use", main=True)
                action("Save drive as TOML", self._save, "sheet-save")
            self._troubles = Troubles("sheet")
            self._text = ui.label().classes("command lines").props('data-testid="sheet-drive" tabindex=0')
            self._text.set_visibility(False)
        self._tried = False
        for field in self._fields.values():
            field.on_value_change(lambda: self._checked() if self._tried else None)

    def _about(self, machine: str) -> None:
        """Show the fields of this machine."""
        for name, machines in ABOUT.items():
            row_of(self._fields[name]).set_visibility(machine in machines)

    def sheet(self) -> DataSheet | None:
        """The contents of the form; None if something is wrong with them, which is shown from then on."""
        self._tried = True
        reveal(self._answer, "nearest")
        return self._checked()

    def _checked(self) -> DataSheet | None:
        """Show what is wrong with the form, or the drive that follows."""
        machine = str(self._fields["machine"].value)
        written = {
            p.path: text
            for p in map(DataSheet.PARAMETERS.__getitem__, self._fields)
            if machine in ABOUT.get(p.name, (machine,))
            and (text := typed(p, str(self._fields[p.name].value)))
        }
        sheet: DataSheet | None = None
        try:
            sheet = DataSheet.from_settings(answered(written))
            title, sentences = "Check these values.", sheet.plausibility_warnings
        except InputError as error:
            title, sentences = "These values make no drive yet.", list(error.sentences)
        self._troubles.say([*(in_words(one, LABELS) for one in sentences)], title)
        self._text.set_visibility(sheet is not None)
        self._text.set_text("" if sheet is None else sheet.drive_toml())
        return sheet

    def _use(self) -> None:
        if (sheet := self.sheet()) is not None:
            self._session.load(sheet.drive)
            notify(f"{cut(sheet.name)} is loaded.")

    def _save(self) -> None:
        if (sheet := self.sheet()) is not None:
            save(sheet.drive_toml(), drive_file(sheet.drive))


def data_sheet_field(p: Parameter) -> ui.input | ui.select:
    """The field of one parameter with an example; below it its value in SI, or what is used without."""
    needed = p.required or p.name == "mass"
    unit = USUAL.get(p.name, p.unit)
    label = p.meaning[0].upper() + p.meaning[1:] + (f", {printed(unit)}" if unit not in ("", "1") else "")
    name = f"sheet-{p.path.replace('.', '-') or p.name}"
    if p.choices:
        words = {word: f"{word}: {about}" for word, about in MACHINES.items()}
        return choice(f"{label} *", words, p.example.strip('"'), name)
    example = "such as " + p.example.strip('"').removesuffix(f" {unit}")
    field = text_field(label + (" *" if needed else ""), "", name, TYPICAL.get(p.name, ("", example))[1])
    with row_of(field):
        note = ui.label().props(f'data-testid="{name}-note"')
    nothing = "" if needed or if_empty(p) == "none" else f"empty: {if_empty(p)}"

    def explain() -> None:
        text = str(field.value)
        try:
            note.set_text(echo(p, text) if text.strip() else nothing)
        except RefusedError as refusal:
            note.set_text(in_usual_unit(p, refusal).reason)

    explain()
    field.on_value_change(explain)
    return field.props(f'placeholder="{example}" maxlength=200')
