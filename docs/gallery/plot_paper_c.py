"""Engagement laws of a friction clutch, and optimal laws
======================================================

How should the torque of a friction clutch rise while it slips? [C] compares four laws of the same duration
by the peak shaft torque and the friction work. Optimal laws give the minimum friction work for each peak,
for nondecreasing laws and for arbitrary laws.
"""

# %%
# The clutch, shaft and load of [C] (in kgf m), and the four laws on the exact plant with renewed slip:
from softstart.views.clutches import engagement_figure
from softstart_studies.paper_c import IN_KGF, optimize_engagement, printed
from softstart_studies.paper_c.fronts import front_figure

runs = printed.engagements()
figure = engagement_figure(list(runs.values()), "The laws of [C]", list(runs), IN_KGF)
figure.set_label("Clutch torque, shaft torque and speeds under the laws of [C].")

# %%
# The minimum friction work for each peak, with fewer points than in the study:
classes = ("any", "nondecreasing")
found = [optimize_engagement(printed.clutch(), 4, law_class=one) for one in classes]
front = front_figure(found)
front.set_label("Friction work over peak shaft torque: the optimal laws, and those of [C].")

# %%
# Optimal laws compared with the linear law:
best = [one.points[0].run for one in found]
names = ["linear", *(f"optimal, {one.law_class}" for one in found)]
laws = engagement_figure([runs["linear"], *best], "The linear law, and two optimal ones", names, IN_KGF)
laws.set_label("The linear law and the laws with the lowest peak.")

# %%
# All tables and verdicts: ``softstart study paper-c --out results`` (12 s); the model is on
# :doc:`/paper-c`.
#
# **References.** [C] Influence of the engagement law of a friction clutch on the load of its elements.
