"""Worn gaps, wrong frequencies, and what stays invariant
======================================================

A strategy that is set up once lives with a gap that grows and with loads that change. [G] concludes that
time-controlled starts fail there, that *acceleration and delay* stands frequencies that are off by 10 to 20
per cent, and that regulators acting on the current limit are invariant. Three pictures say how far that is
true; the verdicts are on :doc:`/paper-g`.
"""

# %%
# Set up for a gap of 0.5 rad and J2 = 5 J1, as [G] has it; then the gap grows to four times its width.
from softstart_studies.paper_g import frequency, invariance, pictures, wear

figure = pictures.wear_figure(wear.wear())
figure.set_label(
    "Torque raised at an instant, and by acceleration and delay, set up for the new gap, while the gap wears."
)

# %%
# The elastic frequency is not the one it was set up for, because the load or the stiffness is another one:
detuned = pictures.frequency_figure([frequency.detuned("load inertia"), frequency.detuned("stiffness")])
detuned.set_label("K_dyn over the deviation of the elastic frequency. Grey: 10 and 20 per cent.")

# %%
# And everything, one at a time, for four strategies:
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
