"""Identification: the parameters of a drive, with honest intervals, from what an inverter logs of starts.

Read in this order: logs.py (a log read and checked), model.py (what the exact plant would have logged, and
how a torque error moves it), fitting.py (search, generalised least squares, restricted maximum likelihood),
planning.py (what an experiment would tell, before it is run), solving.py (`identify`: intervals, what the
logs cannot tell, what the model has not), result.py (the answer, and K_dyn with its interval).
"""
