"""The gentlest start within a given time: torque profiles, their exact check, and how good they provably are.

`optimize` (solving.py) picks a method for a `Problem`, re-simulates its answer with the exact plant and puts
a lower bound beside it. The methods:

- pulse_coast_hold.py: closed form, undamped drives with an active load;
- lp/: linear programs, where nothing but the instants of contact, breakaway and end is not linear;
- collocation/: CasADi, phases of free duration, everything else;
- chains/: the least peak of all shafts of a chain, by successive linear programs on its exact start.

momentum.py and certificate.py prove bounds, exact.py replays and checks an answer, shortest.py has the
shortest start time and verdicts, robust/ one profile for several drives, front.py the curve of K_dyn over
start time.
"""
