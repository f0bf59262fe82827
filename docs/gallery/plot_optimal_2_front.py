"""K_dyn against start time: controllers and optimum
=================================================

Every start strategy is a point in the plane of K_dyn and start time. No start lies below the curve of the
optimum. The figure shows how close the controllers come to it, which use only past measurements.
"""

# %%
# Crane drive of [G], gap 0.5 rad, to 60 rad/s, with fewer points than in the study.
from softstart.views.optima import front_figure
from softstart_studies.optimal_starts import costs, limits
from softstart_studies.optimal_starts.drives import Extent

(front,) = limits.fronts(Extent(gaps=(0.5,), points=4), lambda doing: None)
figure = front_figure(front)
figure.set_label("Lowest K_dyn over the start time, its proved lower bound, and the shipped controllers.")

# %%
# The end condition affects the start time: load at speed (reached), motor and load at speed (synchronous),
# or steady state (steady).
endings = costs.endings_figure([costs.endings(front, lambda doing: None)])
endings.set_label("The same for the three end conditions.")

# %%
# Both gaps, more points: ``softstart study optimal-starts --out results`` (3 min). For your own drive:
# ``softstart pareto mine.toml --out results``.
#
# **References.** [G] R. P. Gerasymiak, V. V. Subbotin, *Dual-mass mechanical part electromechanical system
# behavior analysis*.
