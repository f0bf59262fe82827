"""The gentlest starts of the crane drive
======================================

How gently can a drive with a gap start if it has to be at speed by a given time? The answer is a torque
over time with a proof that no other torque loads the shaft less: pulse, coast, hold. Full torque brings the
motor into the gap, none lets it meet the load without a blow, and from then on the torque holds the shaft
at its peak.
"""

# %%
# Crane drive of [G], gap 0.5 rad, to 60 rad/s; 1.05, 1.2 and 1.5 times the start time of constant torque.
from softstart.start.metrics import base_torque
from softstart_studies.optimal_starts import pictures, profiles
from softstart_studies.optimal_starts.crane import CRANE, TARGET, Extent

found = profiles.starts(Extent(gaps=(0.5,)), lambda doing: None)
figure = pictures.profiles_figure(found, float(base_torque(CRANE)), TARGET)
figure.set_label(
    "Torque of the motor, torque of the shaft and speeds of three optimal starts, on the exact plant."
)

# %%
# The quickest of them leaves no time for a shaft at rest: it swings, and K_dyn is above 1. In figures, with
# the bound that no torque can go below:
for start in found:
    point = start.point
    print(f"{start.multiple:.2f} x direct: K_dyn {point.k_dyn:.6f}, bound {point.k_dyn_lower_bound:.6f}")

# %%
# With the worn gap, all terminals and other drives: ``softstart study optimal-starts --out results`` (3
# min); the theory is on :doc:`/optimal-starts`.
#
# **References.** [G] R. P. Gerasymiak, V. V. Subbotin, *Dual-mass mechanical part electromechanical system
# behavior analysis*.
