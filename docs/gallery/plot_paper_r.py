"""Reduction of four masses to two, and vibration of a chain with gaps
===================================================================

The driveline of a crane or a tractor is a chain of masses, gears and gaps. [R] merges masses until two
remain. The first figure shows the error of the lowest frequency as a function of the merged masses. The
second shows how gaps lower the frequency of the free vibration of a chain and change its shape.
"""

# %%
# Four masses with light middle masses; their share of the inertia and the stiffness of the ends are varied.
from softstart_studies.paper_r import findings, four_to_two

figure = four_to_two.map_figure(four_to_two.error_map())
figure.set_label(
    "Error of the lowest frequency by the lever rule, over the merged share and the stiffness of the ends."
)

# %%
# A chain similar to the tractor T-4. The paper gives speed ratios and gaps; inertias and stiffnesses are
# assumed and marked as such in every output; see :doc:`/paper-r`.
shapes = findings.shapes_figure()
shapes.set_label(
    "First free vibration of the tractor-like chain, without gaps and with gaps of several widths."
)

# %%
# All tables and findings: ``softstart study paper-r --out results`` (30 s).
#
# **References.** [R] V. S. Popovich, R. E. Pestretsov, on reducing torsional systems of machine units with
# gaps.
