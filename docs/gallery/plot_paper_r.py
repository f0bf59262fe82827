"""Four masses as two, and how a chain with gaps swings
====================================================

A crane or a tractor is no two-mass drive but a chain of masses, gears and gaps. [R] merges masses until two
are left. How far off is the lowest frequency then? The first picture maps the error over what was merged.
The second shows how gaps lower the frequency of the free vibration of a chain and change its shape.
"""

# %%
# Four masses, the middle ones light: their share of the inertia, and the stiffness of the ends vary.
from softstart_studies.paper_r import four_to_two, pictures

figure = pictures.map_figure(four_to_two.error_map())
figure.set_label(
    "How low the lever rule puts the lowest frequency, over the share merged and the stiffness of the ends."
)

# %%
# A chain like that of the tractor T-4. The paper prints its speed ratios and gaps; inertias and stiffnesses
# are assumed, and named so in every output; see :doc:`/paper-r`.
shapes = pictures.shapes_figure()
shapes.set_label(
    "First free vibration of the tractor-like chain, without gaps and with gaps of several widths."
)

# %%
# All tables and findings, two pictures more: ``softstart study paper-r --out results`` (50 s).
#
# **References.** [R] V. S. Popovich, R. E. Pestretsov, on reducing torsional systems of machine units with
# gaps.
