"""The balancer of a two-cylinder engine
=====================================

The engine VAZ-11113 has two cylinders that fire evenly; gas and inertia forces excite its mounts in every
turn. [B] designs a two-shaft balancer against the reaction torque, with its imbalance and arm. This page
compares the formulas of [B] with an engine model that includes all orders. The paper gives neither masses
nor pressures; they are assumed and marked as such in every output.
"""

# %%
# The printed formulas and the model, over the speed of the crank; then gas and inertia separately:
from softstart_studies.paper_b.figures import over_speed
from softstart_studies.paper_b.vaz import balanced

found = balanced()
figure, second = over_speed(found)
figure.set_label("Figure 2 of [B]: first order of the reaction torque over the speed of the crank.")
second.set_label("Figure 3 of [B]: first order of the torque of gas, of inertia, and of both.")

# %%
# The torque over the crank angle and its orders, and the residual of the first order for several balancer
# designs:
torque = found.figures["torque"]()
torque.set_label("Reaction torque at 4500 rpm over two turns of the crank, and its orders.")
left = found.figures["residual"]()
left.set_label(
    "Residuals with balancers: first order of the moment, height of the shafts, force on the housing."
)

# %%
# All tables and verdicts: ``softstart study paper-b --out results``; the model is on :doc:`/paper-b`.
#
# **References.** [B] Khalaakin, on reducing the dynamic load of piston engines with balancing mechanisms.
