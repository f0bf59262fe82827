"""Methods 1 and 2 of [G], closed form and exact plant
===================================================

A drive with a gap starts under a reduced torque M1 until the gap is closed and under the full one
afterwards (method 1), or under M1 until the end of the first contact (method 2). How much does a smaller M1
take off the shaft? Gerasymiak and Subbotin [G] answer with closed forms, figures 2 to 4 of their paper.
Here are their curves with the exact plant on top: lines are the closed forms, marks are starts simulated
from event to event. What became of their conclusions is on :doc:`/paper-g`.
"""

# %%
# Gap 0.5 rad, Ms = 62 N m, c = 368.465 N m/rad; J1 = 0.035 kg m2 and two load inertias: the crane drive
# 4AMTKF of [G].
from softstart_studies.paper_g import curves, pictures

figure = pictures.curves_figure(
    curves.figure_2(), 2, "Fig. 2 of [G]: $\\delta_1 = 0.5$ rad, base of $J_2''$", pictures.K_DYN, 3.5
)
figure.set_label(
    "K_dyn of the first contact over M1/Ms, two load inertias. Lines: (17), (18) of [G]; marks: plant."
)

# %%
# The gap four times as wide, as after wear:
worn = pictures.curves_figure(curves.figure_3(), 2, "Fig. 3 of [G]: $J_2'' = 5\\,J_1$", pictures.K_DYN, 5.2)
worn.set_label("The same for a new and a worn gap, J2 = 5 J1.")

# %%
# And what it costs in time:
times = pictures.curves_figure(curves.figure_4(), 3, "Fig. 4 of [G]: $J_2'' = 5\\,J_1$", "time, ms", 250.0)
times.set_label("Durations of the stages over M1/Ms.")

# %%
# All tables and verdicts: ``softstart study paper-g --out results`` (3 s).
#
# **References.** [G] R. P. Gerasymiak, V. V. Subbotin, *Dual-mass mechanical part electromechanical system
# behavior analysis*.
