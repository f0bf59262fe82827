"""Optimal starts as linear programs, exact on their grid, solved by HiGHS.

Read in this order: motion.py (contact and the entry into it), rows.py (rows, HiGHS, grids and their
refinement), ideal.py (a torque that may jump: the program for a fixed entry, and the search for the entry),
whole.py (lag, rate, torque-speed curve, braking: the program over the whole start), whole_search.py (its
orders of phases and instants).
"""
