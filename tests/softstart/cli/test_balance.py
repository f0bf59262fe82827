"""`softstart balance`: the tables, the JSON, the files, and bad input."""

import csv
import json
import math

import numpy as np
import pytest

from softstart import Engine, balance

RPM = math.pi / 30.0
FILES = {
    "report.md",
    "engine.toml",
    "orders.csv",
    "residuals.csv",
    "torque.csv",
    *(f"{stem}.{ending}" for stem in ("torque", "residual", "forces") for ending in ("svg", "png")),
}


def test_json_is_the_summary(as_json):
    told = as_json("balance", "--speed", "4500rpm", "--speed", "1000 rpm")
    found = balance(Engine.load("vaz-11113"), ["4500 rpm", "1000 rpm"])
    assert told == json.loads(json.dumps(found.summary()))
    by_name = {one["name"]: one for one in told["designs"]}
    assert [row["speed"] / RPM for row in by_name["none"]["speeds"]] == pytest.approx([4500.0, 1000.0])
    assert by_name["variable-h-e"]["largest_first_order_moment"] < 1e-9
    assert "masses.*" in told["assumed"]


def test_the_tables_are_shown_and_fit(table):
    flat = table("balance", "--speed", "4500rpm")
    for words in (
        "VAZ-11113",
        "bore 82 mm",
        "Assumed: cylinders.bore",
        "fixed-h-e",
        "constant speed",
        "inertia-only",
    ):
        assert words in flat


def test_changes_count(as_json):
    pressures = 'cycle.mean_indicated_pressure=["7 bar", "8 bar", "7 bar"]'
    changes = [
        "masses.reciprocating=0.5 kg",
        pressures,
        "balancer.tuning_speed=3200rpm",
        "operation.load=0.5",
    ]
    told = as_json("balance", *(word for change in changes for word in ("--set", change)))
    assert told["imbalance"] == pytest.approx(0.5 * 0.0355, rel=1e-12)
    assert told["load"] == 0.5
    full = Engine.load("vaz-11113", also={"cycle.mean_indicated_pressure": ["7 bar", "8 bar", "7 bar"]})
    work = full.indicated_work(3200 * RPM, 1.0) / full.displacement
    assert work == pytest.approx(8e5, rel=1e-12)
    assert told["tuning_speed"] == pytest.approx(3200 * RPM)


def test_the_files(place, done):
    out = done("balance", "--out", "deep/oka")
    assert out.splitlines()[-1].startswith("Written to deep/oka: ")
    folder = place / "deep" / "oka"
    assert {path.name for path in folder.iterdir()} == FILES
    assert (folder / "torque.png").read_bytes().startswith(b"\x89PNG")
    report = (folder / "report.md").read_text("utf-8")
    assert {part.split(")")[0] for part in report.split("](")[1:]} <= FILES
    assert "softstart balance --out deep/oka" in report
    assert Engine.load(folder / "engine.toml") == Engine.load("vaz-11113")
    with (folder / "torque.csv").open(encoding="utf-8") as stream:
        rows = np.array([[float(cell) for cell in row] for row in list(csv.reader(stream))[1:]])
    engine = Engine.load("vaz-11113")
    assert rows[:, 1] == pytest.approx(engine.gas_torque(np.radians(rows[:, 0]), 4500 * RPM), rel=1e-12)


def test_an_engine_without_a_free_force(place, done):
    text = Engine.load("vaz-11113").to_toml()
    text = text.replace('firing_angles = [0.0, "360 deg"]', "firing_order = [1, 3, 4, 2]")
    (place / "four.toml").write_text(text)
    out = done("balance", "four.toml", "--out", "four")
    assert "nothing to balance" in " ".join(out.split())
    assert Engine.load(place / "four" / "engine.toml") == Engine.load(place / "four.toml")


def test_couples_of_three_cylinders_without_gas_data(place, done, as_json):
    """Textbook, three throws at 120 degrees: sqrt(3) m r w^2 a = 1094 N m, lambda times that = 324 N m."""
    (place / "three.toml").write_text("""
[cylinders]
bore = "72 mm"
stroke = "80 mm"
rod_length = "135 mm"
spacing = "80 mm"
firing_order = [1, 3, 2]
[masses]
reciprocating = "0.5 kg"
[operation]
lowest_speed = "1000 rpm"
highest_speed = "6000 rpm"
""")
    out = done("balance", "three.toml", "--out", "three")
    assert "One shaft against the crank with two opposite imbalances" in " ".join(out.split())
    found = as_json("balance", "three.toml")
    couples = {row["order"]: row["couple"] for row in found["orders"]}
    assert couples[1.0] == pytest.approx(1094.0, abs=0.5)
    assert [round(one["at_tuning_speed"]["first_order_couple"]) for one in found["designs"]] == [1094, 547, 0]
    assert couples[2.0] == pytest.approx(324.0 * (1 + (40 / 135) ** 2 / 4), rel=2e-3)  # A_2, not lambda alone
    assert found["indicated_work"] is None
    told = as_json("balance", "three.toml", "--set", "cylinders.spacing=0")
    assert told["free_couple"] is told["orders"][0]["couple"] is told["designs"][0]["largest_couple"] is None
    assert "forces of the cylinders cancel one another: no balancer" in told["note"]
    assert not (place / "three" / "torque.csv").exists()


def test_an_engine_without_gas_data_gets_its_balancer_and_figures(place, done):
    text = Engine.load("vaz-11113").to_toml()
    text = text[: text.index("assumed")] + text[text.index("[cylinders]") : text.index("[cycle]")]
    (place / "two.toml").write_text(
        text + '[operation]\nlowest_speed = "1000 rpm"\nhighest_speed = "5000 rpm"\n'
    )
    assert "Two shafts of 0.02414 kg m together" in done("balance", "two.toml", "--out", "two")
    assert {"residual.svg", "forces.svg"} <= {path.name for path in (place / "two").iterdir()}


ONE_SENTENCE = {
    "engine": (["vaz-1111"], ["did you mean vaz-11113?"]),
    "speed": (["--speed", "50 Hz"], ["--speed", "Hz is a frequency"]),
    "bare speed": (["--speed", "4500"], ['"4500": no unit; write "4500 rpm" or, if rad/s is meant']),
    "speed below 0": (["--speed", "-1"], ['--speed = "-1"', "above 0"]),
    "key": (["--set", "masses.rotatin=1"], ["did you mean masses.rotating?"]),
    "no unit": (["--set", "operation.lowest_speed=9"], ['"9 rpm" or, if rad/s is meant, "9 rad/s"']),
}


@pytest.mark.parametrize(("arguments", "says"), ONE_SENTENCE.values(), ids=ONE_SENTENCE)
def test_one_clear_sentence(arguments, says, refused):
    refused("balance", *arguments, says=says)
