"""Worn gaps, frequency errors, and invariance
===========================================

In service the backlash grows and the load changes while the settings of a strategy stay the same. [G]
concludes that time-controlled starts then fail, that *acceleration and delay* tolerates frequency errors of
10 to 20 per cent, and that regulators acting on the current limit are invariant. Three figures check these
conclusions; the verdicts are on :doc:`/paper-g`.
"""

# %%
# Set up for a gap of 0.5 rad and J2 = 5 J1, as in [G]; then the gap grows to four times its width.
from softstart_studies.paper_g import set_up_once

figure = set_up_once.wear_figure(set_up_once.worn())
figure.set_label(
    "Torque raised at an instant, and by acceleration and delay, set up for the new gap, while the gap wears."
)

# %%
# The actual elastic frequency differs from the assumed one because of a different load or stiffness:
detuned = set_up_once.frequency_figure(set_up_once.detuned("load inertia"), set_up_once.detuned("stiffness"))
detuned.set_label("K_dyn over the deviation of the elastic frequency. Grey: 10 and 20 per cent.")

# %%
# All parameters, one at a time, for four strategies:
over_all = set_up_once.spreads_figure(set_up_once.spreads())
over_all.set_label(
    "K_dyn of the whole start over gap, load inertia and stiffness, each strategy set up once."
)

# %%
# All tables and verdicts: ``softstart study paper-g --out results`` (3 s).
#
# **References.** [G] R. P. Gerasymiak, V. V. Subbotin, *Dual-mass mechanical part electromechanical system
# behavior analysis*.
