"""Variation of backlash and load inertia
======================================

Which strategy is suitable for a machine whose backlash grows and whose load changes? Every controller is
tuned in the same way, for each cell of a grid of gaps and inertias and once for all cells, and compared
with the optimum of the cell.
"""

# %%
# Crane drive of [G], torque lag 2 ms (assumed), to 60 rad/s. This page uses two cells, two controllers and
# a short search; the study has 5 by 4 cells and all controllers.
from softstart_studies.gaps_and_inertias import Extent, grid, present

extent = Extent(
    gaps=(0.5, 2.0),
    inertias=(5.0,),
    front_points=5,
    restarts=1,
    generations=3,
    controllers=("ramp", "pulse-coast-hold"),
)
result = present(grid(extent, lambda doing: None), lambda doing: None)
figure = result.figures["gaps-and-inertias-active-cells"]
figure.set_label(
    "Ratio of K_dyn to the optimum for the same time, gains tuned for each cell; a dash: no optimum exists."
)

# %%
# One set of gains for all cells:
one_set = result.figures["gaps-and-inertias-active-one-set"]
one_set.set_label("The same with one set of gains, tuned for the worst cell.")

# %%
# The whole grid: ``softstart study gaps-and-inertias --out results`` (15 min); the findings are on
# :doc:`/gaps-and-inertias`.
#
# **References.** [G] R. P. Gerasymiak, V. V. Subbotin, *Dual-mass mechanical part electromechanical system
# behavior analysis*.
