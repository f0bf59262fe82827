"""The balancer of a two-cylinder engine
=====================================

The engine VAZ-11113 has two cylinders that fire evenly; gas and masses shake its mounts with every turn.
[B] designs a balancer of two shafts against the reaction torque and finds its imbalance and arm. Here its
formulas stand beside an engine model with all orders. The paper prints neither masses nor pressures: they
are assumed, and named so in every output.
"""

# %%
# The printed formulas and the model, over the speed of the crank:
from softstart_studies.paper_b import over_speed
from softstart_studies.paper_b.vaz import balanced

found = balanced()
curves = over_speed.curves(found)
figure = over_speed.figure_2(curves)
figure.set_label("Figure 2 of [B]: first order of the reaction torque over the speed of the crank.")

# %%
# Gas and inertia apart:
second = over_speed.figure_3(curves)
second.set_label("Figure 3 of [B]: first order of the torque of gas, of inertia, and of both.")

# %%
# The torque over the crank angle and its orders, and what several designs of a balancer leave of the first
# one:
drawn = found.figures()
torque = drawn["torque"]
torque.set_label("Reaction torque at 4500 rpm over two turns of the crank, and its orders.")
left = drawn["residual"]
left.set_label(
    "What balancers leave: first order of the moment, height of their shafts, force on the housing."
)

# %%
# All tables and verdicts: ``softstart study paper-b --out results``; the model is on :doc:`/paper-b`.
#
# **References.** [B] Khalaakin, on reducing the dynamic load of piston engines with balancing mechanisms.
