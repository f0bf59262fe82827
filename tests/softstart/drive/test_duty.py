"""Duties: their files, what machines keep of them, and one sentence for every step that cannot be."""

from __future__ import annotations

import math
import pickle
from pathlib import Path

import numpy as np
import pytest

from softstart import Chain, Drive, Duty, DutyStep, InputError, Machine, Shift, machine_table, simulate
from softstart.chain import Mass, Motor, Shaft
from softstart.drive.duty import check_duty, way_of_stop

CRANE = Drive.load("crane-4amtkf")
CHAIN = Chain.load("crane-4-mass")
HOIST = Drive.load("hoist-15kw")
SHIFT = Duty.load("travel-crane")


def sentences(steps: str, machine: str = "", where: str = "my.toml") -> list[str]:
    """The sentences on a file with these steps, "do key=value key=value; do ..."."""
    tables = []
    for step in steps.split("; "):
        do, *pairs = step.split()
        lines = [f'do = "{do}"', *(pair.replace("=", " = ") for pair in pairs)]
        tables.append("\n".join(["[[duty]]", *lines]))
    kind = type(CRANE) if machine else Duty
    with pytest.raises(InputError) as error:
        kind.from_toml("\n".join([machine, *tables]), where=where)
    assert all(one.startswith(f"{where}: ") for one in error.value.sentences)
    return [one.removeprefix(f"{where}: ") for one in error.value.sentences]


# ---- reading and writing --------------------------------------------------------------------------------


def test_the_shift_of_a_travel_crane() -> None:
    """400 starts, 400 stops and 150 jogs in eight hours, counted from the expanded cycle."""
    assert SHIFT.shift is not None
    cycles = SHIFT.shift.cycles_per_hour * SHIFT.shift.hours
    counts = [cycles * sum(s.do == do for _, s in SHIFT.expanded()) for do in ("start", "stop", "jog")]
    assert counts == [400.0, 400.0, 150.0]


@pytest.mark.parametrize("name", Duty.LIBRARY.names())
def test_each_shipped_duty_can_be_repeated(name: str) -> None:
    duty = Duty.load(name)
    assert duty.shift is not None
    assert not duty.ends_moving


def test_repeats_are_expanded_up_to_the_stop() -> None:
    duty = Duty(
        [
            DutyStep("start", repeat=2),
            DutyStep("hold", time=1),
            DutyStep("stop"),
            DutyStep("jog", time="0.1 s", repeat=3),
            DutyStep("start"),
        ]
    )
    assert [index for index, _ in duty.expanded()] == [0, 1, 2, 0, 1, 2, 3, 3, 3, 4]
    assert all(step is duty.steps[index] for index, step in duty.expanded())
    assert duty.ends_moving
    assert not SHIFT.ends_moving


@pytest.mark.parametrize("machine", [CRANE, CHAIN, HOIST], ids=["drive", "chain", "hoist"])
def test_a_machine_keeps_its_duty(machine: Machine) -> None:
    duty = SHIFT.replace(steps=[*SHIFT.steps, DutyStep("load", torque="5 N*m", kind="reactive")])
    assert machine.duty is None
    one = machine.replace(duty=duty, brake_torque="300 N*m", opening_delay="20 ms")
    for same in (type(machine).from_toml(one.to_toml()), pickle.loads(pickle.dumps(one)), one.replace()):
        assert same == one
        assert hash(same) == hash(one)
        assert same.duty == duty
    assert one.replace(duty=None, brake_torque=None, opening_delay=0) == machine
    assert one.with_gap_and_inertia(0.2, 1.0).duty == duty
    assert all(at.duty == duty for at in one.positions.values())


def test_a_table_keeps_the_duty() -> None:
    table = machine_table(CRANE.replace(duty=SHIFT), gap=[0.1, 0.5])
    assert [one.duty for one in table.elements()] == [SHIFT, SHIFT]


def test_a_table_of_brakes() -> None:
    """Each machine of a table has its own release and its own lock."""
    table = machine_table(CRANE, opening_delay=[0.05, 0.1], brake_torque=[20.0, math.inf])
    each = list(table.elements())
    assert [(one.brake, one.release_time, one.brake_torque) for one in each] == [
        ("motor", 0.05, 20.0),
        ("motor", 0.1, math.inf),
    ]
    single = [
        simulate(CRANE.replace(brake_torque=20.0, opening_delay=delay), "direct") for delay in (0.05, 0.1)
    ]
    assert simulate(table, "direct").peak_torque.values.tolist() == [one.peak_torque for one in single]


def test_a_duty_in_a_file_of_its_own(tmp_path: Path) -> None:
    assert Duty.from_toml(SHIFT.to_toml()) == SHIFT
    (tmp_path / "shift.toml").write_text(SHIFT.to_toml(), encoding="utf-8")
    assert Duty.load(tmp_path / "shift.toml") == SHIFT
    assert Drive.from_toml(CRANE.to_toml() + SHIFT.to_toml()) == CRANE.replace(duty=SHIFT)


def test_units_of_steps() -> None:
    step = DutyStep("hold", angle="2 turn", set_speed="-60 rpm")
    assert (step.angle, step.set_speed) == pytest.approx((4.0 * math.pi, -2.0 * math.pi))
    assert Shift(cycles_per_hour=50) == Shift(cycles_per_hour=50.0, hours=8, shifts_per_year=250)


# ---- the brake ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("machine", [CRANE, CHAIN], ids=["drive", "chain"])
def test_a_brake_opens_after_its_delay(machine: Machine) -> None:
    """Without [brake] there is none; one opens `opening_delay` after the command of the start."""
    assert (machine.brake, machine.brake_torque, machine.release_time) == ("none", 0.0, 0.0)
    braked = machine.replace(brake_torque="90 N*m", opening_delay="100 ms", closing_delay="60 ms")
    assert (braked.brake, braked.brake_torque, braked.closing_delay) == ("motor", 90.0, 0.06)
    assert (braked.opening_delay, braked.release_time) == (0.1, 0.1)
    assert machine.replace(closing_delay="60 ms").brake_torque == math.inf  # an ideal lock
    run = simulate(braked, "direct")
    assert run.release_time == 0.1
    held, free = (run.at(time)["w1" if machine.KIND == "drive" else "w"] for time in (0.0999, 0.1001))
    assert np.ravel(held)[0] == 0.0 < np.ravel(free)[0]
    assert abs(run.energy.residual) < 1e-12 * abs(run.energy.motor)


def test_the_load_hangs_behind_the_brake() -> None:
    """Wound up by its torque, as the shaft of the same two masses as a drive is."""
    braked = CHAIN.replace(brake_torque=90.0)
    assert braked.position == "hanging"
    torques = braked.at_motor_shaft()
    twist = torques.theta0 - 0.5 * torques.gap
    assert twist * torques.c == pytest.approx([7.16] * 3, rel=1e-12)
    masses = [mass.replace(kind="reactive") for mass in CHAIN.masses]
    assert CHAIN.replace(brake_torque=90.0, masses=masses).position == "mid-gap"


def test_torque_proving_and_a_release_at_a_time_stay_as_they_are() -> None:
    proving = HOIST.replace(brake_torque="300 N*m", opening_delay="50 ms")
    assert HOIST.release_time == proving.release_time == math.inf
    timed = HOIST.replace(brake_torque="300 N*m", release="0.2 s")
    assert timed.release_time == 0.2
    with pytest.raises(InputError, match=r"^release = 0\.2 s: .*opening_delay = 0\.05 s .*leave one out"):
        timed.replace(opening_delay="50 ms")
    assert CRANE.replace(brake="none", brake_torque=90.0).release_time == 0.0  # open at the start


# ---- one sentence for each mistake ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("steps", "sentence"),
    [
        ("stop", '[duty] 1, do = "stop": the machine stands; a step "start" must come before it.'),
        ("start; stop; brake", '[duty] 3, do = "brake": the machine stands; a step "start"'),
        ("reverse", '[duty] 1, do = "reverse": the machine stands; a step "start" must come before it.'),
        ("hold angle=3", "[duty] 1, angle = 3.0: the machine stands; give a time, or start it before."),
        ("start; start", '[duty] 2, do = "start": the machine starts at rest, and it runs since step 1'),
        ("start; jog time=1", '[duty] 2, do = "jog": the machine is jogged at rest, and it runs'),
        ("start; load torque=1", '[duty] 2, do = "load": the machine changes its load at rest, and it'),
        ("jog", "[duty] 1, time is missing: a jog is a start of given time"),
        ("jog time=0", "[duty] 1, time = 0: the time of the step must be above 0."),
        ("start; hold", "[duty] 2, time is missing: a hold takes a time or an angle"),
        ("start torque=5", '[duty] 1, torque = 5.0: a step "start" has no torque; it has set_speed, time'),
        ("start; brake by='coast'", '[duty] 2, by = "coast": a step "brake" has no by; it has time'),
        ("start; stop repeat=2", '[duty] 2, repeat = 2.0: a step "stop" has no repeat; it has by, '),
        ("start repeat=2; hold time=1", "[duty] 1, repeat = 2: no step stops the machine again"),
        ("start repeat=1.5; stop", "[duty] 1, repeat = 1.5: the number of times in a row must be a whole"),
        ("start; stop brake_speed=1 brake_time=1", "[duty] 2, brake_speed = 1.0 and brake_time = 1.0: both"),
        ("start; stop braking_torque=9", '[duty] 2, braking_torque = 9.0: only a stop by = "torque" has one'),
        ("start set_speed=0", '[duty] 1, set_speed = 0: a set speed is not 0; use a step "stop"'),
        ("start; reverse set_speed=9", "[duty] 2, set_speed = 9.0: the machine runs forward already"),
        ("start set_speed=-9; reverse set_speed=-9", "[duty] 2, set_speed = -9.0: the machine runs back"),
        ("start set_speed=-9; hold time=1 set_speed=9", "[duty] 2, set_speed = 9.0: the machine runs backw"),
        ("start; reverse; hold time=1 set_speed=9", "[duty] 3, set_speed = 9.0: the machine runs backwards"),
        ("start speed=3", "[duty] 1, speed = 3: [duty] has no key speed; did you mean set_speed?"),
        ("load", '[duty] 1, a step "load" changes torque, kind, inertia or friction of the load'),
        ("strat", '[duty] 1, do = "strat": the kind of the step is "start", "stop", '),
        ("jog tiem=3", "[duty] 1, tiem = 3: [duty] has no key tiem; did you mean time?"),
    ],
)  # fmt: skip
def test_one_sentence_for_each_step_that_cannot_be(steps: str, sentence: str) -> None:
    found = sentences(steps)
    assert any(one.startswith(sentence) for one in found), found


def test_all_mistakes_at_once_also_those_of_the_machine() -> None:
    text = CRANE.to_toml().replace("gap = 0.5 ", "gap = -1 ")
    assert [one.split(":")[0] for one in sentences("stop; start; start", machine=text)] == [
        "[duty] 1, do = \"stop\"",
        "[duty] 3, do = \"start\"",
        "[shaft] gap = -1",
    ]  # fmt: skip


def test_a_shift_without_steps_and_things_of_another_kind() -> None:
    with pytest.raises(InputError, match=r"^\[\[duty\]\] is missing: a duty has steps"):
        Drive.from_toml(CRANE.to_toml() + "[shift]\ncycles_per_hour = 3")
    with pytest.raises(InputError, match=r'^duty = "stop": it takes a duty, which Duty\(...\) makes.$'):
        CRANE.replace(duty="stop")
    for wrong in ("start", ["start"]):
        with pytest.raises(InputError, match=r'^steps = "start": it takes a step of a duty'):
            Duty(wrong)
    with pytest.raises(InputError, match=r"^repeat: one cycle has 2e\+30 steps, and a duty at most 10000;"):
        Duty([DutyStep("start", repeat=1e30), DutyStep("stop")])


ANYTHING = [
    "nan", "inf", "1e308", "5e-324", "-1", "0", "true", "[1, 2]", "{a = 1}", '""', '"5 xyzzy"', '"-5 %"',
    '"0,5 rad"', "1979-05-27", '"\\u0000"', '"start"',
]  # fmt: skip


@pytest.mark.parametrize("key", DutyStep.PARAMETERS)
def test_whatever_stands_in_a_file_is_read_or_refused(key: str) -> None:
    refusals = list[str]()
    for value in ANYTHING:
        rest = "" if key == "do" else 'do = "start"\n'
        try:
            Drive.from_toml(f"{CRANE.to_toml()}[[duty]]\n{rest}{key} = {value}\n")
        except InputError as error:
            refusals += error.sentences
    assert len(refusals) > 8
    assert all(key in sentence for sentence in refusals)


@pytest.mark.parametrize("text", ["[duty]\ndo = 3", "[[shift]]\nhours = 3", "[shift]\nhours = 'x'"])
def test_tables_of_another_kind(text: str) -> None:
    with pytest.raises(InputError):
        Drive.from_toml(CRANE.to_toml() + text)


@pytest.mark.parametrize(
    ("word", "meant"),
    [("pause", "hold"), ("wait", "hold"), ("brems", "brake"), ("halt", "stop"), ("strat", "start")],
)
def test_another_word_for_a_step(word: str, meant: str) -> None:
    assert sentences(word)[0].endswith(f'did you mean "{meant}"?')


def test_a_shift_lasts_a_day_at_most_and_a_day_has_three() -> None:
    assert Shift(cycles_per_hour=1, hours=24, shifts_per_year=3 * 366)
    for wrong in ({"hours": 24.1}, {"shifts_per_year": 3 * 366 + 1}):
        with pytest.raises(InputError, match=f"^{next(iter(wrong))} = "):
            Shift(cycles_per_hour=1, **wrong)


def test_the_file_of_a_machine_is_no_duty() -> None:
    for machine in (CRANE.replace(duty=SHIFT), CHAIN):
        with pytest.raises(InputError, match=r"^my\.toml: this is the file of a machine; [^\n]*$"):
            Duty.from_toml(machine.to_toml(), where="my.toml")


def test_counts_are_written_as_whole_numbers() -> None:
    assert "repeat = 8  #" in SHIFT.to_toml()
    assert "cycles_per_hour = 6.25  #" in SHIFT.to_toml()


# ---- with a machine and a strategy ----------------------------------------------------------------------

LIFT = CRANE.replace(
    brake_torque="20 N*m", opening_delay="50 ms", minimum_torque="-30 N*m"
)  # 7.16 N m, active
CYCLE = [DutyStep("start"), DutyStep("stop")]


def refused(machine: Machine, *steps: DutyStep, stop: str | None = None, able: bool = False) -> list[str]:
    """The sentences on these steps under a strategy that can stop and holds the speed, or that cannot."""
    try:
        check_duty(machine, Duty(steps), stop, able, able, able, "ramp")
    except InputError as error:
        return list(error.sentences)
    return []


@pytest.mark.parametrize("able", [False, True])
def test_a_machine_that_can(able: bool) -> None:
    free = CRANE.replace(load_kind="reactive")
    for machine in (LIFT, free, CHAIN.replace(brake_torque=20.0), HOIST.replace(brake_torque="400 N*m")):
        assert refused(machine, *CYCLE, DutyStep("jog", time=1), able=able) == []
    assert refused(LIFT, DutyStep("start"), DutyStep("reverse"), able=able) == []


def test_the_way_of_a_stop() -> None:
    """As the step says; else the strategy, what is configured, the torque of the motor, coasting."""
    ways = [(DutyStep("stop", by="brake"), True), (DutyStep("stop"), True), (DutyStep("stop"), False)]
    assert [way_of_stop(step, LIFT, "coast", can) for step, can in ways] == ["brake", "strategy", "coast"]
    assert [way_of_stop(DutyStep("stop"), one, None, False) for one in (LIFT, CRANE)] == ["torque", "coast"]


@pytest.mark.parametrize("machine", [LIFT, CHAIN.replace(brake_torque=20.0)], ids=["drive", "chain"])
def test_a_brake_weaker_than_the_load(machine: Machine) -> None:
    """The load of 7.16 N m at the motor shaft, by statics, in either kind of machine; also a later one."""
    (sentence,) = refused(machine.replace(brake_torque=7.15), *CYCLE, stop="brake")
    assert sentence.startswith(
        "[brake] torque = 7.15: it is weaker than the load, 7.16 N*m at the motor shaft"
    )
    assert refused(machine.replace(brake_torque=7.17), *CYCLE, stop="brake") == []
    heavy = 20.0 if machine.KIND == "drive" else 20.0 * 20.0  # the crane turns 20 times slower
    lifted = [DutyStep("load", torque=1.01 * heavy), *CYCLE]
    (sentence,) = refused(machine, *lifted, stop="brake")
    assert sentence.startswith('[duty] 1, do = "load": the brake of 20 N*m is weaker than the load, 20.2 N*m')
    assert refused(machine, DutyStep("load", torque=0.99 * heavy), *CYCLE, stop="brake") == []
    assert (
        refused(machine, DutyStep("load", torque=1.01 * heavy, friction=0.1 * heavy), *CYCLE, stop="brake")
        == []
    )


def test_a_brake_that_the_gear_helps() -> None:
    """A worm gear of efficiency 0.6 lets 0.6 of the load through to the motor."""
    chain = Chain(
        [Mass(0.05, name="motor"), Mass(2.0, torque=100.0)],
        [Shaft(500.0, ratio=20, efficiency=0.6)],
        Motor(30, rated_speed=100),
    )
    assert chain.overhauling_torque == pytest.approx(3.0)
    assert refused(chain.replace(brake_torque=3.01), *CYCLE, stop="brake") == []
    assert len(refused(chain.replace(brake_torque=2.99), *CYCLE, stop="brake")) == 1


def test_a_counterweight() -> None:
    """0.1 + 0.2 N m against 0.3 N m are balanced, whatever binary makes of their sum."""
    masses = [Mass(0.1, torque=torque) for torque in (0.1, 0.2, -0.3)]
    assert 0.1 + 0.2 - 0.3 != 0.0
    assert Chain(masses, [Shaft(5.0)] * 2, Motor(9.0)).overhauling_torque == 0.0


BACK = [DutyStep("start", set_speed=-90)]
COAST, TORQUE = DutyStep("stop", by="coast"), DutyStep("stop", by="torque", braking_torque=7.0)
LOCK = CRANE.replace(closing_delay=0.1)


@pytest.mark.parametrize(
    ("machine", "steps", "stop", "sentence"),
    [
        (CRANE, CYCLE, "torque", '[duty] 2, do = "stop" by torque: the motor has no braking torque; give a '),
        (LIFT, [CYCLE[0], DutyStep("stop", by="torque", braking_torque=31)], None,
         "[duty] 2, braking_torque = 31.0: the motor has less, [motor] minimum_torque = -30.0"),
        (CRANE, CYCLE, "brake", '[duty] 2, do = "stop" by brake: the machine has no brake; add [brake] torq'),
        (CRANE, [CYCLE[0], DutyStep("brake")], None, '[duty] 2, do = "brake": the machine has no brake; add'),
        (LOCK, [CYCLE[0], DutyStep("brake")], None, '[duty] 2, do = "brake": without [brake] torque the bra'),
        (LOCK, [CYCLE[0], DutyStep("stop", brake_speed=3)], None, "[duty] 2, brake_speed = 3.0: without [br"),
        (LOCK, [CYCLE[0], DutyStep("stop", brake_time=0)], None, "[duty] 2, brake_time = 0.0: without [brak"),
        (CRANE, CYCLE, None, '[duty] 2, do = "stop" by coast: nothing holds the load, 7.16 N*m at the motor'),
        (CRANE, [DutyStep("jog", time=1)], None, '[duty] 1, do = "jog" by coast: nothing holds the load, 7.'),
        (LIFT, [*BACK, COAST], None, '[duty] 2, by = "coast": the load, 7.16 N*m at the motor shaft besides'),
        (LIFT, [*BACK, TORQUE], None, '[duty] 2, by = "torque": the load, 7.16 N*m at the motor shaft besid'),
        (CRANE.replace(load_torque=0), CYCLE, "coast", '[duty] 2, do = "stop" by coast: nothing brakes the '),
        (LIFT, CYCLE, "strategy", '[duty] 2, do = "stop" by strategy: ramp cannot stop a machine; stop by'),
        (LIFT, [DutyStep("start", set_speed=185)], None, "[duty] 1, set_speed = 185 rad/s: it is above 2 "),
        (LIFT, [CYCLE[0], DutyStep("hold", time=1, set_speed=9)], None, "[duty] 2, set_speed = 9.0: ramp do"),
        (LIFT, [DutyStep("load", torque=5, mass="hook")], None, '[duty] 1, mass = "hook": a drive has one l'),
        (CHAIN, [DutyStep("load", torque=5, mass="cran")], None, '[duty] 1, mass = "cran": the chain has no '
         'mass of this name; did you mean "crane"?'),
        (LIFT, [DutyStep("load", torque=-5, kind="reactive")], None, "[duty] 1, load_torque = -5 N*m: a rea"),
        (LIFT, [DutyStep("load", torque=70)], None, "[duty] 1, starting_torque = 62 N*m: the starting torqu"),
        (LIFT, [DutyStep("jog", time=0.05)], None, "[duty] 1, time = 0.05: the jog ends before the brake is"),
        (LIFT, CYCLE, "cost", 'stop = "cost": the stop is "strategy", "torque", "coast" or "brake"; did you'),
    ],
)  # fmt: skip
def test_one_sentence_for_what_a_machine_cannot_do(
    machine: Machine, steps: list[DutyStep], stop: str | None, sentence: str
) -> None:
    found = refused(machine, *steps, stop=stop)
    assert len(found) == 1
    assert found[0].startswith(sentence), found


def test_stops_of_a_load_that_drives_on() -> None:
    """Lowering ends by the brake in motion, or by more torque than that of the load; lifting by itself."""
    stronger = TORQUE.replace(braking_torque=7.2)
    for stop in (stronger, DutyStep("stop", by="brake"), COAST.replace(brake_time=0.2)):
        assert refused(LIFT, *BACK, stop) == []
    assert refused(LIFT, *BACK, COAST.replace(brake_speed=95)) == []  # closes at once
    assert len(refused(LIFT, *BACK, COAST.replace(brake_speed=85))) == 1
    assert len(refused(LIFT, DutyStep("start"), DutyStep("reverse"), COAST)) == 1
    assert refused(LIFT, *BACK, DutyStep("reverse"), COAST) == []
    assert refused(LIFT, DutyStep("start"), COAST) == []
    assert refused(LIFT, *BACK, COAST.replace(time=0.1)) == []  # over by then


def test_the_load_that_the_first_cycle_leaves() -> None:
    """It is picked up at the end and never set down: the second cycle begins with it."""
    free = LIFT.replace(brake_torque=None, opening_delay=0, load_kind="reactive")
    steps = [DutyStep("start"), DutyStep("stop", by="torque"), DutyStep("load", kind="active")]
    (sentence,) = refused(free, *steps)
    assert sentence.startswith('[duty] 2, by = "torque": nothing holds the load, 7.16 N*m')
    assert refused(free, *steps, DutyStep("load", kind="reactive")) == []


def test_all_that_a_machine_cannot_do_at_once() -> None:
    wrong = [DutyStep("start", set_speed=300), DutyStep("brake"), DutyStep("load", torque=1, mass="hook")]
    assert [one.split(",")[0] for one in refused(CRANE, *wrong)] == ["[duty] 1", "[duty] 2", "[duty] 3"]


def test_a_mass_that_stays_at_rest_has_no_load() -> None:
    wall = Chain([*CHAIN.masses, Mass(math.inf, name="wall")], [*CHAIN.shafts, Shaft(500.0)], CHAIN.motor)
    (sentence,) = refused(wall, DutyStep("load", torque=5, mass="wall"))
    assert sentence.startswith('[duty] 1, mass = "wall": it stays at rest')


# ---- as typed --------------------------------------------------------------------------------------------


def test_settings_of_steps() -> None:
    drive = CRANE.replace(duty=SHIFT)
    settings = {"duty[2].time": "5 s", "shift.cycles_per_hour": "10"}
    changed = drive.with_settings([*(f"{key}={value}" for key, value in settings.items()), "gap=1 rad"])
    assert changed.gap == 1.0
    assert changed.duty is not None
    assert changed.duty.shift is not None
    assert (changed.duty.steps[1].time, changed.duty.shift.cycles_per_hour) == (5.0, 10.0)
    chain = Chain.from_toml(CHAIN.replace(duty=SHIFT).to_toml(), also=settings)
    assert chain.duty == changed.duty
    with pytest.raises(InputError) as error:
        drive.with_settings(["duty[9].time=1", "gapp=1"])
    assert [one.split(";")[0] for one in error.value.sentences] == [
        'gapp=1: there is no parameter "gapp"',
        "duty[9].time: write duty[N].time with N from 1 to 5.",
    ]
    with pytest.raises(InputError, match=r"^duty\[1\].time=3: the drive has no duty; add \[\[duty\]\]"):
        CRANE.with_settings(["duty[1].time=3"])


def test_a_duty_of_its_own_file_at_the_output_of_the_machine(tmp_path: Path) -> None:
    """The same steps in the file of the machine say what is expected."""
    steps = '[[duty]]\ndo = "start"\nset_speed = "2 rad/s at output"\n'
    (tmp_path / "own.toml").write_text(steps, encoding="utf-8")
    geared = CRANE.replace(gear_ratio=40, gear_efficiency=0.8)
    own = Duty.load_for(geared, str(tmp_path / "own.toml"))
    assert own == Drive.from_toml(geared.to_toml() + steps).duty
    assert own.steps[0].set_speed == 80.0
    for machine, says in ((CRANE, "without gear.ratio"), (CHAIN, "the gears of a chain")):
        with pytest.raises(InputError, match=says):
            Duty.load_for(machine, str(tmp_path / "own.toml"))


def test_a_speed_that_was_meant_in_rpm() -> None:
    (sentence,) = refused(LIFT, DutyStep("start", set_speed=880), DutyStep("stop", by="brake"))
    assert sentence.startswith("[duty] 1, set_speed = 880 rad/s: it is above 2 times the rated or target")
    assert sentence.endswith('; did you mean "880 rpm"?')
    (sentence,) = refused(LIFT, DutyStep("start", set_speed=8800), DutyStep("stop", by="brake"))
    assert sentence.endswith("the torque assumed here.")


def test_values_at_the_output() -> None:
    """A torque that drives the motor loses on its way: M eta/i; one that brakes it is M/(i eta)."""
    steps = [f'[[duty]]\ndo = "load"\ntorque = "{torque} N*m at output"\n' for torque in (320, -320)]
    steps.append('[[duty]]\ndo = "start"\nset_speed = "-2 rad/s at output"\n')
    steps.append('[[duty]]\ndo = "hold"\nangle = "1 turn at output"\n')
    text = CRANE.replace(gear_ratio=40, gear_efficiency=0.8).to_toml() + "".join(steps)
    up, down, start, hold = Drive.from_toml(text).duty.steps  # type: ignore[union-attr]
    assert (up.torque, down.torque, start.set_speed) == pytest.approx((10.0, -6.4, -80.0), rel=1e-15)
    assert hold.angle == pytest.approx(80.0 * math.pi, rel=1e-15)
    for machine in (CRANE, CHAIN):
        with pytest.raises(
            InputError, match=r'^\[duty\] 1, torque = "320 N\*m at output": .*at the motor shaft'
        ):
            type(machine).from_toml(machine.to_toml() + steps[0])
