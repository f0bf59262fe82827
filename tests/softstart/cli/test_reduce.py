"""`softstart reduce`: tables, JSON, files that work, and refusals."""

from __future__ import annotations

import json
import re

import pytest
from tests.twin import chain_of

from softstart import Drive
from softstart.chain import Chain, Mass, Shaft, reduce_chain


def test_json_is_the_summary(as_json):
    told = as_json("reduce", "--no-starts")
    found = reduce_chain(Chain.load("crane-4-mass"))
    assert found.summary().items() <= told.items()
    assert told["vibration"]["modes"][0]["Omega"] == 0.0
    assert told["drive"]["load_inertia"] == found.to_drive().J2
    assert told["reduced"]["node"] == pytest.approx(told["whole"]["node"], rel=1e-12)
    assert abs(told["frequencies"][0]["error"]) < 1e-14
    assert told["assumed"] == found.chain.assumed


def test_the_tables_are_shown(monkeypatch, done):
    monkeypatch.setenv("COLUMNS", "110")
    out = done("reduce", "tractor-like", "--no-starts")
    assert "Two masses instead of 15 (condition: 13.7, at least 10)" in out
    assert "assumed: every inertia" in out
    assert max(map(len, out.splitlines())) <= 110


def test_what_is_written_can_be_used(run, place):
    code, _, _ = run("reduce", "--set", "shaft[3].gap=0.02", "--out", "found", "--no-starts")
    assert code == 0
    folder = place / "found"
    drive = Drive.load(folder / "drive.toml")
    assert drive.gap == pytest.approx(0.1 + 0.2 + 0.4)
    chain = Chain.load(folder / "chain.toml")
    assert chain == Chain.load("crane-4-mass", also={"shaft[3].gap": 0.02})
    report = (folder / "report.md").read_text()
    for path in folder.iterdir():
        if path.suffix in (".csv", ".svg", ".toml"):
            assert path.name in report, path.name
    assert "assumed" in report
    assert len((folder / "shapes.csv").read_text().splitlines()) == 1 + 4
    assert (folder / "shapes.png").read_bytes().startswith(b"\x89PNG")
    assert run("simulate", "found/drive.toml", "--controller", "direct", "--json").code == 0


def test_refused_with_the_ratio_unless_forced(run, nothing_left):
    asked = ("reduce", "tractor-like", "--factor", "20")
    code, out, err = run(*asked, "--out", "found")
    assert code == 2
    assert "Natural frequencies" in out
    assert "(256.071/69.1286)^2 = 13.7 is below the 20" in err
    assert "--force" in err
    nothing_left()
    assert run(*asked, "--force", "--json", "--no-starts").code == 0


def test_natural_frequencies_come_first_whatever_cannot_be_reduced(run, place):
    """Five masses; the published frequencies."""
    masses = [Mass(J) for J in (3.5e-3, 3.5e-3, 3.5e-3, 0.15, 0.05)]
    chain = Chain(masses, [Shaft(c) for c in (12e3, 12e3, 14e3, 10e3)])
    (place / "five.toml").write_text(chain.to_toml())
    code, out, err = run("reduce", "five.toml")
    assert (code, err.count("\n")) == (2, 1)
    found = [line.split()[-1] for line in out.splitlines() if re.match(r"[\d., -]+$", line)]
    assert found == ["0.00", "81.21", "141.21", "378.95", "536.36"]
    code, out, _ = run("reduce", "five.toml", "--json")
    told = json.loads(out)
    assert code == 2
    assert [f"{mode['frequency']:.2f}" for mode in told["vibration"]["modes"]] == found
    assert err == f"softstart: {told['refused'][0]}\n"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("tractor",), "shipped"),
        (("good.toml",), "did you mean [[mass]] inertia?"),
        (("--set", "start.load=rotor"), "motor and load are the same mass"),
        (("--factor", "0.5"), "--factor = 0.5"),
        (("--set", "shaft[1].gap=5 m"), "m is a length"),
        (("--set", "motor.mass=rotr"), "did you mean"),
        (("--verify", "rampp"), '--verify = "rampp": there is no controller'),
        (("--verify", "ramp", "--no-starts"), "give one of the two"),
        (("--param", "ramp.time=1"), "--param: it sets up a controller of --verify"),
    ],
)
def test_bad_input_in_one_sentence(run, nothing_left, arguments, said):
    """What the chain is comes before what is wrong with the question."""
    code, _, err = run("reduce", *arguments)
    assert code == 2
    assert said in err
    assert "Traceback" not in err
    nothing_left()


def test_a_start_designed_on_the_drive_is_verified_on_the_chain(run, place):
    from softstart import simulate

    code, out, _ = run("reduce", "--verify", "direct,ramp", "--out", "found", "--json")
    assert code == 0
    told = json.loads(out, parse_constant=pytest.fail)["verified"]
    assert [one["controller"] for one in told] == ["direct", "ramp"]
    drive = reduce_chain(Chain.load("crane-4-mass")).to_drive()
    for one in told:
        assert one["k_dyn"] == simulate(drive, one["controller"]).k_dyn
        whole = simulate("crane-4-mass", one["controller"], fitted_to=drive, base=drive)
        assert one["chain_k_dyn"] == whole.k_dyn
        assert one["chain_start_time"] == whole.start_time
        assert one["worst_shaft"] == "rotor - pinion"
        assert one["k_dyn_error"] == pytest.approx(one["chain_k_dyn"] / one["k_dyn"] - 1.0)
    rows = (place / "found" / "verified.csv").read_text().splitlines()
    assert len(rows) == 3
    assert "verified on the chain" in (place / "found" / "report.md").read_text()


def test_another_order_on_the_chain_is_told(run, place):
    done = run("reduce", "--verify", "pulse-coast-hold,ramp", "--json", "--out", "found")
    told = json.loads(done.out)
    pulse, ramp = told["verified"]
    assert pulse["k_dyn"] < ramp["k_dyn"] < ramp["chain_k_dyn"] < pulse["chain_k_dyn"]
    verdict = told["verdict"]
    assert verdict["order_differs"]
    assert verdict["order_on_chain"] == ["ramp", "pulse-coast-hold"] == verdict["order_on_drive"][::-1]
    assert verdict["of_strategies"]["pulse-coast-hold"] == pulse["chain_k_dyn"] / pulse["k_dyn"] - 1.0
    assert not verdict["enough"]
    assert "On the chain ramp is gentler than pulse-coast-hold (K_dyn 3.27 and 4.05)" in verdict["said"]
    assert "pulse-coast-hold has K_dyn 4.05 on the chain and 0.981 on them" in verdict["said"]
    assert verdict["said"] in (place / "found" / "report.md").read_text().replace("\\_", "_")
    (place / "two.toml").write_text(chain_of(Drive.load("crane-4amtkf")).to_toml())
    out = run("reduce", "two.toml", "--verify", "pulse-coast-hold,ramp").out
    assert "verified on the chain" in out
    assert "Two masses are enough: K_dyn of pulse-coast-hold, ramp and under 128 torques" in out
    assert "Choose by the chain" not in out


def test_a_command_for_drives_names_the_reduction_of_a_chain(refused):
    refused("plan", "crane-4-mass", says=["this is a chain", "softstart reduce crane-4-mass --out DIR"])


def test_commands_go_on_with_the_chain_itself(run, place, as_json):
    told = as_json("linear", "crane-4-mass", "--controller", "ramp")
    assert told["drive"] == Chain.load("crane-4-mass").name
    asked = ("crane-4-mass", "--controller", "s-curve")
    axes = ("--axis", "shaft[2].gap=0.5x:2x:3", "--axis", "start.position=unknown")
    code, out, _ = run("sweep", *asked, *axes, "--json", "--out", "swept")
    assert code == 0
    cells = json.loads(out)["cells"]
    assert [cell["shaft_2_gap"] for cell in cells] == [0.1, 0.25, 0.4]
    assert {"k_dyn_1", "k_dyn_2", "k_dyn_3"} <= set(cells[0])
    assert (place / "swept" / "chain.toml").is_file()
    few = ("--gaps", "1x", "--inertias", "1x", "--free", "time", "--restarts", "1", "--only", "robust")
    code, out, _ = run("tune", *asked, *few, "--out", "tuned", "--json")
    found = json.loads(out)["robust"]
    assert (code, found["worst"] <= found["worst_default"]) == (0, True)
    told = as_json("simulate", "tuned/chain.toml", "--controller", "tuned/robust.toml")
    assert told["controller"] == "s-curve (robust)"


def test_a_parameter_of_a_controller_to_verify(run):
    asked = ("--verify", "ramp", "--param", "ramp.time=0.3 s", "--json")
    done = run("reduce", "--set", "shaft[2].efficiency=0.9", *asked)
    (one,) = json.loads(done.out)["verified"]
    assert one["chain"]["parameters"]["time"] == 0.3
    assert one["gear_losses"] > 0.0
