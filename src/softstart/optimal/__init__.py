"""The gentlest start within a given time: the torque over time, its exact check, and how good it provably is.

`optimize` (optimize.py) answers a `Problem` (problem.py). Where it holds, the closed form of
pulse_coast_hold.py is the answer; else the descent of descent.py, successive linear programs on the exact
start (starts.py), from the first demands of seeds.py. check.py runs each answer again; bounds.py and
duality.py say how much better any start could be. statement.py is the same problem as one program of
CasADi, front.py the curve of K_dyn over the start time.
"""
