"""Method 2 of [G] over the whole start
====================================

Method 2 has a much lower peak than method 1 if only the first contact is considered. [G] raises the torque
when that contact ends, by equation (15). The gap is then open, the motor accelerates, and the *second*
contact occurs under full torque. If the torque is raised at the peak of the first contact instead, by (14),
the gap stays closed.
"""

# %%
# The crane drive of [G], J2 = 5 J1, gaps of 0.5 and 2 rad; each mark is a whole start, to its last contact.
from softstart_studies.paper_g import whole_start
from softstart_studies.paper_g.crane import GAP_1, GAP_2

figure = whole_start.figure([whole_start.whole_start(gap) for gap in (GAP_1, GAP_2)])
figure.set_label("K_dyn of the first contact and of the whole start over M1/Ms.")

# %%
# The same in time, with M1 = Ms/4:
in_time = whole_start.traces_figure()
in_time.set_label("Shaft torque of the two starts; grey: gap open.")

# %%
# Numerical values:
for name, run in whole_start.traces().items():
    print(f"{name}: K_dyn {run.k_dyn:.4f}, {run.contacts} contacts, start time {run.start_time:.4f} s")

# %%
# All tables and verdicts: ``softstart study paper-g --out results`` (3 s).
#
# **References.** [G] R. P. Gerasymiak, V. V. Subbotin, *Dual-mass mechanical part electromechanical system
# behavior analysis*.
