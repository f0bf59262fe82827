"""The optimum as feedback
=======================

Pulse, coast, hold as a profile is only good for the gap and the load that it was computed for. The
controller ``pulse-coast-hold`` makes the same start from what an inverter measures, motor angle and motor
torque, with gap, load inertia and load speed unknown. How near does it come to the optimum that knows
everything?
"""

# %%
# Crane drive of [G] with a torque lag of 2 ms, encoder of 4096 lines, 1 kHz; told a gap of 0.5 rad,
# whatever it is.
from softstart_studies.pulse_coast_hold import cells, pictures
from softstart_studies.pulse_coast_hold.crane import Extent

extent = Extent(kinds=("active",), gaps=(0.5, 2.0), ratios=(2.0, 5.0), phases=4)
figure = pictures.starts_figure(extent)
figure.set_label("Starts at the corners of gap and load inertia, with one set of parameters.")

# %%
# K_dyn over that of the optimum in the same time, at the corners (the study has four gaps and four
# inertias, 16 places of the encoder, and both kinds of load):
grids = {kind: cells.grid(kind, extent, lambda doing: None) for kind in extent.kinds}
ratios = pictures.ratios_figure(grids)
ratios.set_label("K_dyn over the optimum in the same time, by gap and load inertia.")

# %%
# The whole grid, tolerances and rivals: ``softstart study pulse-coast-hold --out results`` (4 min); the
# theory is on :doc:`/pulse-coast-hold`.
#
# **References.** [G] R. P. Gerasymiak, V. V. Subbotin, *Dual-mass mechanical part electromechanical system
# behavior analysis*.
