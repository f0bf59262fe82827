"""The gentlest start within a given time: the torque over time, its exact check, and how good it provably is.

`optimize` (optimize.py) answers a `Problem` (problem.py). Where it holds, the closed form of
pulse_coast_hold.py is the answer; else path.py follows starts from first demands (seeds.py) and from other
start times by the descent of descent.py: successive linear programs (model.py, program.py) on the exact start
(starts.py) over the unknowns of a demand (demand.py). check.py runs each answer again; bounds.py and
duality.py say how much better any start could be. statement.py is the same problem as one program of
CasADi, front.py the curve of K_dyn over the start time.
"""
