"""One torque profile for several drives: the least worst K_dyn, and what a sensor of the contact is worth.

A profile is a staircase (shape.py), played by the `profile` controller on the exact plant (plays.py). The
shaft torques and their differences (differences.py) make a linear program for a small change
(linear_step.py); descent.py repeats that as long as the exact plant agrees; families.py and search.py find
where to begin; pursuit.py leads from many starts down to one; solving.py answers.
"""

from softstart.optimal.robust.outcome import RobustOptimum, SensorWorth
from softstart.optimal.robust.scenarios import scenarios_of
from softstart.optimal.robust.solving import optimize_robust, worth_of_contact_sensor

__all__ = ["RobustOptimum", "SensorWorth", "optimize_robust", "scenarios_of", "worth_of_contact_sensor"]
