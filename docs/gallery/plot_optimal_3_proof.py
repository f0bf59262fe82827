"""From the statement to the proof, on one drive
=============================================

How does a computed optimum become a proved one? The walk goes from the statement through the best torque to
the multipliers that show that no other torque is gentler. All symbols are those of :doc:`/theory/optimum`.
"""

# %%
# **Statement.** Crane drive of [G] behind a torque lag of 5 ms, to 60 rad/s within 0.288 s: find the torque
# demand whose largest shaft torque *P* is least. ``problem.casadi()`` is this statement for another solver.
import numpy as np

from softstart import Drive, optimize
from softstart.optimal.problem import Problem
from softstart.optimal.whole_certificate import dual_at
from softstart.views.drawing import drawing, new_figure

drive = Drive.load("crane-4amtkf").replace(target_speed=60.0, torque_lag=0.005)
problem = Problem(drive, start_time=0.2883042)
best = optimize(drive, problem.start_time)
P = best.run.peak_torque
print(f"{best.method}: P = {P:.4f} N m, K_dyn {best.k_dyn:.5f}")

# %%
# **Primal.** The demand is a pulse, a coast, and what holds the shaft torque at *P*; the lag rounds it off.
end = best.end_time
times = np.linspace(0.0, end + 0.5 * drive.elastic_period, 1500)
state = best.run.at(times)
with drawing():
    primal, axes = new_figure(size=(8.0, 3.6))
    axes.step(best.profile.time, best.profile.torque, where="post", color="0.7", label="demand $r$")
    axes.plot(times, state["u"], color="#0072B2", label="motor torque $u$")
    axes.plot(times, state["T"], color="#D55E00", label="shaft torque $T$")
    axes.axhline(P, color="k", linewidth=0.8, linestyle=":", label="$P$")
    axes.axvline(end, color="0.5", linewidth=0.8)
    axes.set(xlim=(0.0, times[-1]), xlabel="time in s", ylabel="torque in N m")
    axes.legend(loc="lower right")
primal.set_label(
    "Primal: the best torque, and the shaft torque that it holds at P up to the end of the start."
)

# %%
# **Dual.** Each limit has a multiplier. The density *m* says what the limit T <= P costs at each instant (its
# integral is 1), and the adjoint state gives the weight *q* of the demand. For *every* demand r of a start
# with one contact, at this instant, P >= constants + integral of q r. The least that any demand can make of
# this is r at its highest where q < 0 and at its lowest where q > 0. The pulse ends where q changes its sign,
# and while T is held, q is 0.
contact = best.run.first_contact
dual = dual_at(problem, (contact, contact, end))
instants, q = dual.weights(dual.by.durations)
m = dual.by.torque[: dual.start.tail + dual.by.durations[2]]
with drawing():
    figure, (above, below) = new_figure(2, size=(8.0, 5.2), sharex=True)
    above.step(instants[: m.size], m, where="pre", color="#D55E00")
    above.set(ylabel="$m$ in 1/s", xlim=(0.0, times[-1]))
    below.plot(instants, q, color="#0072B2")
    full = {"color": "#0072B2", "alpha": 0.2, "label": "$q < 0$: highest demand"}
    below.fill_between(instants, q, 0.0, where=q < 0.0, **full)
    below.axhline(0.0, color="k", linewidth=0.8)
    below.set(xlabel="time in s", ylabel="$q$ in 1/s")
    below.legend(loc="lower right")
figure.set_label("Dual: the price of T <= P over time, and the weight of the demand.")

# %%
# **Value.** The constants and the integral together, for the instants of this start:
gap, _, steps = dual.by.durations
F = dual.nodes(np.array([steps]), np.array([gap]), False).item()
print(f"F = {F:.4f} N m, {100.0 * (P / F - 1.0):.2f} % below P")

# %%
# **Proof for all instants.** The same multipliers give a bound for other times in the gap and in contact.
# These two durations are cut into cells; a cell has the least of its corners, less what a function of this
# curvature can fall between them. Further programs supply multipliers until all cells are within 0.1 %:
print(f"every start with one contact: K_dyn >= {best.bound.k_dyn:.5f}, found {best.k_dyn:.5f}")
print(best.bound.covers)

# %%
# For your own drive: ``softstart optimize mine.toml --start-time 1.2x``.
#
# **References.** [G] R. P. Gerasymiak, V. V. Subbotin, *Dual-mass mechanical part electromechanical system
# behavior analysis*. HiGHS and CasADi: :doc:`/theory/references`.
