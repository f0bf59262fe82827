"""The duty in a report: its steps are those of `run_duty`, and a machine without one has no such section."""

from __future__ import annotations

import pytest

from softstart import Chain, Drive, Duty, DutyStep, run_duty
from softstart.reporting import Report, report

from .conftest import Page

DUTY = Duty([DutyStep("start"), DutyStep("hold", time=1.0), DutyStep("stop"), DutyStep("jog", time=0.2)])
CONVEYOR = Drive.load("conveyor-11kw").replace(permissible_torque=180.0, duty=DUTY)


@pytest.fixture(scope="module")
def made() -> Report:
    return report(CONVEYOR, controllers=["ramp"], budget=0.0)


@pytest.fixture(scope="module")
def read(made: Report) -> Page:
    return Page(made.to_html())


def test_steps_and_worst_step_are_those_of_run_duty(made, read):
    ramp = next(row.controller for row in made.comparison.rows if row.name == "ramp")  # set for the limits
    runs = {"direct": run_duty(CONVEYOR, "direct"), "ramp": run_duty(CONVEYOR, ramp)}
    table = read.rows("life over direct")
    for name, run in runs.items():
        assert table[name]["K 4 jog"] == f"{run.k_dyn_of(run.rows[3]):.3f}"
    steps = read.rows("to do")
    for row in runs["ramp"].rows:
        assert steps[str(row.number)]["K_dyn"] == f"{runs['ramp'].k_dyn_of(row):.3f}"
        assert steps[str(row.number)]["contacts"] == str(row.contacts)
    worst = runs["ramp"].worst
    assert f"Worst step: {worst.number}, {worst.step.do}, K_dyn {runs['ramp'].k_dyn:.3f}" in read.text
    assert "Life: damage-equivalent torque" in read.text
    assert made.summary()["duty"]["strategies"][0]["controller"] == "direct"


def test_the_section_is_in_the_contents_and_has_a_picture_of_the_worst_step(made, read):
    assert "duty" in read.ids
    assert ("a", "href", "#duty") in read.attributes
    worst = made.duties.rows[1].run.worst
    caption = f"ramp: the worst step, {worst.number}, {worst.step.do}, with the end of the step before it"
    assert caption in read.text
    assert "kind of the step" not in read.text  # the table of data leaves the steps to this section


def test_a_machine_without_a_duty_has_no_such_section(page):
    assert 'id="duty"' not in page


@pytest.mark.slow
@pytest.mark.parametrize("machine", [Drive.load("crane-4amtkf"), Chain.load("crane-4-mass")])
def test_a_duty_that_cannot_be_carried_out_is_a_sentence_and_the_report_is_made(machine):
    """A load that drives a machine which nothing brakes."""
    made = report(machine.replace(duty=DUTY), controllers=["ramp"], budget=0.0)
    assert isinstance(made.duties, str)
    text = Page(made.to_html()).text
    assert "The duty of the file cannot be carried out. [duty] 3" in text
