"""A drive from new to worn
========================

One drive, its gap from 0.5 rad on: which strategy keeps its promise over that life, and what is it worth to
tune it for the new drive, for all of its life with one set of gains, or with a schedule over the gap?
"""

# %%
# Crane drive of [G], torque lag 2 ms (assumed), to 60 rad/s. Two controllers, a short search and gaps up to
# 2 rad here; the study tunes all of them with more effort and goes on to 4 rad.
from softstart_studies.wear import Extent, live, present

extent = Extent(
    life=(0.5, 1.0, 2.0),
    scheduled=(0.5, 2.0),
    restarts=1,
    generations=3,
    controllers=("ramp", "pulse-coast-hold"),
    front_points=4,
)
result = present(live(extent, lambda doing: None), lambda doing: None)
figure = result.figures["wear-life"]
figure.set_label("K_dyn over the life, by how the gains were chosen.")

# %%
# A start that takes longer can be gentler, so K_dyn alone does not say who is good; beside the optimum in
# the same time it does:
ratio = result.figures["wear-over-optimum"]
ratio.set_label("The same over the least K_dyn of any start in the same time.")

# %%
# All controllers: ``softstart study wear --out results`` (3 min); the findings are on
# :doc:`/gaps-and-inertias`.
#
# **References.** [G] R. P. Gerasymiak, V. V. Subbotin, *Dual-mass mechanical part electromechanical system
# behavior analysis*.
