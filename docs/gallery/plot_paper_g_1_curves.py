"""Methods 1 and 2 of [G], closed form and exact plant
===================================================

A drive with backlash starts with a reduced torque M1 until the gap is closed and with full torque
afterwards (method 1), or with M1 until the end of the first contact (method 2). How much does M1 reduce the
shaft torque? Gerasymiak and Subbotin [G] give closed forms, figures 2 to 4 of their paper. This page shows
their curves together with the exact plant: lines are the closed forms, marks are starts simulated from
event to event. Their conclusions are checked on :doc:`/paper-g`.
"""

# %%
# Gap 0.5 rad, Ms = 62 N m, c = 368.465 N m/rad; J1 = 0.035 kg m2 and two load inertias: the crane drive
# 4AMTKF of [G].
from softstart_studies.paper_g import curves

drawn = curves.figures()
figure = curves.figure("2", drawn["2"])
figure.set_label(
    "K_dyn of the first contact over M1/Ms, two load inertias. Lines: (17), (18) of [G]; marks: plant."
)

# %%
# With the gap worn to four times its width:
worn = curves.figure("3", drawn["3"])
worn.set_label("The same for a new and a worn gap, J2 = 5 J1.")

# %%
# Durations of the stages:
times = curves.figure("4", drawn["4"])
times.set_label("Durations of the stages over M1/Ms.")

# %%
# All tables and verdicts: ``softstart study paper-g --out results`` (3 s).
#
# **References.** [G] R. P. Gerasymiak, V. V. Subbotin, *Dual-mass mechanical part electromechanical system
# behavior analysis*.
