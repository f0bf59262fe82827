"""Optimal starts of the crane drive
=================================

What is the lowest peak shaft torque of a drive with backlash that has to reach its speed within a given
time? The optimal torque profile, with a proof of optimality, is pulse, coast, hold: full torque accelerates
the motor in the gap, zero torque limits the impact, and then the torque holds the shaft torque at its peak.
"""

# %%
# Crane drive of [G], gap 0.5 rad, to 60 rad/s; 1.05, 1.2 and 1.5 times the start time of constant torque.

from softstart_studies.optimal_starts import profiles
from softstart_studies.optimal_starts.drives import Extent

found = profiles.starts(Extent(gaps=(0.5,)), lambda doing: None)
figure = profiles.figure(found)
figure.set_label(
    "Torque of the motor, torque of the shaft and speeds of three optimal starts, on the exact plant."
)

# %%
# For the shortest start time the shaft torque oscillates, and K_dyn is above 1. Values of K_dyn and the
# proved lower bound for any torque:
for start in found:
    point = start.point
    print(f"{start.multiple:.2f} x direct: K_dyn {point.k_dyn:.6f}, bound {point.k_dyn_lower_bound:.6f}")

# %%
# With the worn gap and all terminals: ``softstart study optimal-starts --out results`` (3
# min); the theory is on :doc:`/optimal-starts`.
#
# **References.** [G] R. P. Gerasymiak, V. V. Subbotin, *Dual-mass mechanical part electromechanical system
# behavior analysis*.
