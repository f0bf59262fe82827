"""The optimum as a feedback controller
====================================

As a torque profile, pulse, coast, hold is valid only for the gap and load for which it was computed. The
controller ``pulse-coast-hold`` realises the same start from the measured motor angle and motor torque, with
unknown gap, load inertia and load speed. This page compares it with the optimum for known data.
"""

# %%
# Crane drive of [G] with a torque lag of 2 ms, encoder of 4096 lines, 1 kHz; always set up for a gap of 0.5
# rad.
from softstart_studies.pulse_coast_hold import Extent, corners_figure, ratios_figure, run

extent = Extent(kinds=("active",), gaps=(0.5, 2.0), ratios=(2.0, 5.0), phases=4)
figure = corners_figure(extent)
figure.set_label("Starts at the corners of gap and load inertia, with one set of parameters.")

# %%
# Ratio of K_dyn to the optimum for the same time, at the corners (the study has four gaps and four
# inertias, 16 encoder phases, and both kinds of load):
grids = {kind: run(kind, extent.gaps, extent.ratios, extent.phases) for kind in extent.kinds}
ratios = ratios_figure(grids)
ratios.set_label("Ratio of K_dyn to the optimum for the same time, by gap and load inertia.")

# %%
# The whole grid and the tolerances: ``softstart study pulse-coast-hold --out results`` (4 min); the theory
# is on :doc:`/pulse-coast-hold`.
#
# **References.** [G] R. P. Gerasymiak, V. V. Subbotin, *Dual-mass mechanical part electromechanical system
# behavior analysis*.
