"""The stages of a start in closed form: equations (1)-(18) of [G].

While the gap is open (odd stage) motor and load move freely; while it is closed (even stage) the elastic
torque `T` (`M12` in [G]) swings about the mean that accelerates the load. Without dissipation. Results are
those of the first opening and the first contact of a start from rest in mid-gap (`theta = 0`);
`softstart.simulate` follows the contacts after that, other starts, damping, torque lag and limits.

Common to every function here: arguments are floats or arrays that broadcast together, in SI units with angles
in rad at the motor shaft; floats in give a float out, otherwise an array of the broadcast shape. Arguments
outside their range (`J1 <= 0`, `gap < 0`, NaN ...) raise one `InputError` that names them all.

Symbols: `J1, J2` inertias of motor and load, kg m2; `c` stiffness, N m/rad; `gap` total angular gap, rad;
`M1` motor torque of the stage, `Mc` load torque, `Ms` starting torque, N m; `t` time since the stage began,
s; `Omega` elastic frequency, rad/s; `mean` mean shaft torque of the stage, N m; `dw12` speed of impact,
rad/s; `r` ratio M1/Ms.

Load. An active load torque acts always, so it turns a free load backwards; (1)-(18) hold for it. A reactive
one (Coulomb friction, `kind="reactive"`) leaves the load at rest in stage 1: the terms with `Mc` vanish from
(2)-(6) and so from (10). That is all [G] says of it. In stage 2 a reactive load stays stuck until `T > Mc`,
so (11)-(15), (17) and (18) do not hold; `reactive_peak_shaft_torque` and `reactive_contact_stage_duration`
are exact there, and `method_1` and `method_2` use them.

[G]: R. P. Gerasymiak, V. V. Subbotin, Dual-mass mechanical part electromechanical system behavior analysis,
pages 18-20. Doctests: its crane drive with J2 = 5 J1.
"""

from softstart.stages.coefficient import (
    TwoStages,
    dynamic_coefficient,
    dynamic_coefficient_of_impact,
    dynamic_coefficient_of_stages,
    method_1,
    method_2,
)
from softstart.stages.contact import (
    contact_stage_duration,
    elastic_frequency,
    mean_shaft_torque,
    peak_shaft_torque,
    shaft_torque,
    shaft_torque_amplitude,
    shaft_torque_phase,
    time_of_peak,
)
from softstart.stages.open_gap import (
    closing_angles,
    closing_speeds,
    impact_speed,
    open_stage_angles,
    open_stage_duration,
    open_stage_speeds,
)
from softstart.stages.reactive import reactive_contact_stage_duration, reactive_peak_shaft_torque

__all__ = [
    "TwoStages",
    "closing_angles",
    "closing_speeds",
    "contact_stage_duration",
    "dynamic_coefficient",
    "dynamic_coefficient_of_impact",
    "dynamic_coefficient_of_stages",
    "elastic_frequency",
    "impact_speed",
    "mean_shaft_torque",
    "method_1",
    "method_2",
    "open_stage_angles",
    "open_stage_duration",
    "open_stage_speeds",
    "peak_shaft_torque",
    "reactive_contact_stage_duration",
    "reactive_peak_shaft_torque",
    "shaft_torque",
    "shaft_torque_amplitude",
    "shaft_torque_phase",
    "time_of_peak",
]
