"""Gains tuned over gaps and load inertias: a schedule, one robust set, and the price of robustness.

What is minimised: K_dyn, or another figure, of the worst start (or a quantile) that gains are judged by, as
long as these starts keep the bound on the start time; trials.py computes this cost of a candidate in one
batch. `tune` (solving.py) reads the problem (problem.py, ranges.py); gains.py searches the gains of all
cells at once by differential evolution (search.py). tables.py and outcome.py hold what was found.
"""
