"""The gentlest start within a given time: torque profiles, their exact check, and how good they provably are.

`optimize` (solving.py) picks a method for a `Problem`, re-simulates what it finds with the exact plant and
puts a lower bound beside it. The methods:

- pulse_coast_hold.py: closed form, undamped drives with an active load;
- linear_program.py: contact instant fixed, HiGHS, search over the contact instant;
- whole/: the same over the whole start, for a torque with lag, limits of rate or speed, or braking;
- collocation/: CasADi, phases of free duration, everything else.

certificate.py proves the bound, checking.py throws out what the plant contradicts, robust/ finds one profile
for several drives, front.py the curve of K_dyn against start time.
"""
