"""Identification: the parameters of a drive, with honest intervals, from what an inverter logs of starts.

Read in this order: logs.py (a log read and checked), model.py (what the exact plant would have logged),
unknowns.py (which numbers a fit finds), fitting.py (the likelihood, and intervals from it), solving.py (what
the logs cannot tell, and what the model has not), result.py (the answer, its file, and draws); planning.py
(which experiment to run); wear.py (the gap over the years).
"""
