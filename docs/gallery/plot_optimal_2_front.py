"""K_dyn against start time, and where controllers stand
=====================================================

Every start strategy is a point in a plane: how hard it loads the shaft, and how long it takes. Below the
curve of the optimum there is nothing. How near do controllers come, which know the drive but not the
future?
"""

# %%
# Crane drive of [G], gap 0.5 rad, to 60 rad/s; fewer points than the study takes.
from softstart.views.optima import front_figure
from softstart_studies.optimal_starts import fronts, pictures, terminals
from softstart_studies.optimal_starts.crane import Extent

(front,) = fronts.fronts(Extent(gaps=(0.5,), points=4), lambda doing: None)
figure = front_figure(front)
figure.set_label("The least K_dyn over the start time, its proven lower bound, and the shipped controllers.")

# %%
# What holds at the end costs time: only the load at speed (reached), motor and load together (synchronous),
# or all of it at rest in the moving frame (steady).
endings = pictures.terminals_figure([terminals.endings(front, lambda doing: None)])
endings.set_label("The same for the three ways in which a start may end.")

# %%
# Both gaps, more points: ``softstart study optimal-starts --out results`` (3 min). On a drive of your own:
# ``softstart pareto mine.toml --out results``.
#
# **References.** [G] R. P. Gerasymiak, V. V. Subbotin, *Dual-mass mechanical part electromechanical system
# behavior analysis*.
