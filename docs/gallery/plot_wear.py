"""Effect of wear over the service life
====================================

The gap of a drive grows from 0.5 rad on. Which strategy keeps its K_dyn over the service life, and what is
the benefit of tuning for the new drive, of one set of gains for the whole life, or of a schedule over the
gap?
"""

# %%
# Crane drive of [G], torque lag 2 ms (assumed), to 60 rad/s. This page uses two controllers, a short search
# and gaps up to 2 rad; the study tunes all controllers with more effort and gaps up to 4 rad.
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
figure.set_label("K_dyn over the service life, for each choice of gains.")

# %%
# A longer start can have a lower K_dyn, so strategies are compared by the ratio to the optimum for the same
# start time:
ratio = result.figures["wear-over-optimum"]
ratio.set_label("Ratio to the lowest K_dyn of any start in the same time.")

# %%
# All controllers: ``softstart study wear --out results`` (3 min); the findings are on
# :doc:`/gaps-and-inertias`.
#
# **References.** [G] R. P. Gerasymiak, V. V. Subbotin, *Dual-mass mechanical part electromechanical system
# behavior analysis*.
