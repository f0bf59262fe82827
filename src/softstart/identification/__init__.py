"""Identification: the parameters of a drive, with honest intervals, from what an inverter logs of starts.

Which errors does an interval include? What the encoder rounds, and an independent torque error in each
sample, of a size that is only known as far as the log tells it; not an error of the model or of the torque's
scale. `fitting.py` says how: its head has the likelihood.

What can a log not tell? Where an interval is wider than a factor of 3, `identify` calls the parameter
unknown, with the reason; what the model has not is a note, and then no interval is stated (`solving.py`).

Which experiment should be run? `plan_experiments` computes expected intervals of standard experiments, and
designs a torque (`planning.py`).

Read in this order: logs.py (a log read and checked), model.py (what the exact plant would have logged),
unknowns.py (which numbers a fit finds), fitting.py, solving.py, result.py (the answer, its file, draws, and
K_dyn with its interval); wear.py (the gap over the years).
"""
