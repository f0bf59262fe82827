"""Worn gaps, frequency errors, and invariance
===========================================

In service the backlash grows and the load changes while the settings of a strategy stay the same. [G]
concludes that time-controlled starts then fail, that *acceleration and delay* tolerates frequency errors of
10 to 20 per cent, and that regulators acting on the current limit are invariant. Three figures check these
conclusions; the verdicts are on :doc:`/paper-g`.
"""

# %%
# Set up for a gap of 0.5 rad and J2 = 5 J1, as in [G]; then the gap grows to four times its width.
from softstart_studies.paper_g import frequency, invariance, pictures, wear

figure = pictures.wear_figure(wear.wear())
figure.set_label(
    "Torque raised at an instant, and by acceleration and delay, set up for the new gap, while the gap wears."
)

# %%
# The actual elastic frequency differs from the assumed one because of a different load or stiffness:
detuned = pictures.frequency_figure([frequency.detuned("load inertia"), frequency.detuned("stiffness")])
detuned.set_label("K_dyn over the deviation of the elastic frequency. Grey: 10 and 20 per cent.")

# %%
# All parameters, one at a time, for four strategies:
spreads = [invariance.spread(*strategy) for strategy in invariance.STRATEGIES]
over_all = pictures.invariance_figure(spreads)
over_all.set_label(
    "K_dyn of the whole start over gap, load inertia and stiffness, each strategy set up once."
)

# %%
# All tables and verdicts: ``softstart study paper-g --out results`` (3 s).
#
# **References.** [G] R. P. Gerasymiak, V. V. Subbotin, *Dual-mass mechanical part electromechanical system
# behavior analysis*.
