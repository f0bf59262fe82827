"""One torque profile for several drives: the least worst K_dyn, and what a sensor of the contact is worth.

Read in this order: evaluation.py (a staircase of torque on the exact plant, with sensitivities), descent.py
(the linear program for a small change, repeated while the exact plant agrees), guesses.py (where descents
begin), solving.py (scenarios, the search from many starts down to one, the answer).
"""

from softstart.optimal.robust.solving import optimize_robust, scenarios_of, worth_of_contact_sensor

__all__ = ["optimize_robust", "scenarios_of", "worth_of_contact_sensor"]
