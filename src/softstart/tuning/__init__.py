"""Gains tuned over gaps and load inertias: a schedule, one robust set, and the price of robustness.

`tune` (solving.py) reads the question (question.py, ranges.py), tries candidates (trials.py) in searches
(search.py) whose parts are spread over threads, processes or a cluster (work.py), and finds the best gains of
each cell and one set for all (gains.py). tables.py and outcome.py hold what was found.
"""
