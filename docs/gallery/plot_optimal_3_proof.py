"""From the statement to the bound, on one drive
=============================================

How good is a computed optimum? The walk goes from the statement through the closed form and the descent to
the bounds that no torque goes below. All symbols are those of :doc:`/theory/optimum`.
"""

# %%
# **Statement.** Crane drive of [G], to 60 rad/s within 0.288 s: find the torque with the lowest peak *P* of
# the shaft torque. ``problem.casadi()`` is this statement for another solver.
import numpy as np

from softstart import Drive, TorqueProfile, optimize
from softstart.optimal.bounds import momentum_bound
from softstart.optimal.descent import Descent
from softstart.optimal.problem import Problem
from softstart.views.drawing import drawing, new_figure

drive = Drive.load("crane-4amtkf").replace(target_speed=60.0)
problem = Problem(drive, start_time=0.2883042, terminal="reached")
best = optimize(drive, problem.start_time, terminal="reached")
P = best.run.peak_torque
print(f"{best.method}: P = {P:.4f} N m, K_dyn {best.k_dyn:.6f}")

# %%
# **Closed form and descent.** Pulse, coast, hold is optimal here. The descent from constant torque
# (successive linear programs on the exact start) does not know this form and finds it.
search = Descent(problem, best.end_time)
found = search.down(TorqueProfile([0.0], [search.high]), soft=40)
assert found is not None
found = search.refined(found)
print(f"descent: K_dyn {found.peak / problem.base_torque:.6f}")
times = np.linspace(0.0, best.end_time + 0.5 * drive.elastic_period, 1500)
state = best.run.at(times)
with drawing():
    primal, axes = new_figure(size=(8.0, 3.6))
    axes.plot(found.profile.time, found.profile.torque, color="0.6", label="motor torque of the descent")
    axes.plot(times, state["u"], color="#0072B2", label="motor torque $u$")
    axes.plot(times, state["T"], color="#D55E00", label="shaft torque $T$")
    axes.axhline(P, color="k", linewidth=0.8, linestyle=":", label="$P$")
    axes.axvline(best.end_time, color="0.5", linewidth=0.8)
    axes.set(xlim=(0.0, times[-1]), xlabel="time in s", ylabel="torque in N m")
    axes.legend(loc="lower right")
primal.set_label("The optimal torque, that of the descent, and the shaft torque that is held at P.")

# %%
# **Bounds.** Momentum: the load gains its speed from a shaft torque of at most *P*, which cannot begin before
# the first contact. For this drive the bound is the optimum. Where K_dyn is above 1 no torque holds *P*, and
# momentum alone leaves much open; there weak duality shows that no torque of a start with one contact is
# better by more than 0.5 %.
for start_time in (0.2883042, 0.2522662):
    best = optimize(drive, start_time, terminal="reached", bounds=True)
    momentum = momentum_bound(Problem(drive, start_time, "reached")).k_dyn
    bound = best.bound_once or best.bound
    print(f"{start_time} s: K_dyn {best.k_dyn:.5f}, momentum {momentum:.5f}, {bound.kind} {bound.k_dyn:.5f}")
    print(f"  covers {bound.covers}")

# %%
# For your own drive: ``softstart optimize mine.toml --start-time 1.2x``.
#
# **References.** [G] R. P. Gerasymiak, V. V. Subbotin, *Dual-mass mechanical part electromechanical system
# behavior analysis*. HiGHS and CasADi: :doc:`/theory/references`.
