"""Optimal starts by direct collocation: CasADi, phases of free duration, IPOPT.

Read in this order: program.py (which motions follow each other, in the drive's own units), statement.py (the
mathematics: dynamics, path constraints, boundary conditions, objective), transcription.py (the same as a
nonlinear program), guess.py (where the search begins), search.py (`solve`: starts, retries, refinement). All
but program.py import CasADi: they are loaded when a problem needs them.
"""
