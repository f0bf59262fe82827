"""Starts a second, beside LSODA
=============================

softstart writes down the motion between two events and the instant of the next one; a general integrator
finds the same curve by hundreds of steps. The same starts to the same end, each contender in a process of
its own, rates by processor time.
"""

# %%
# Constant and staged torque against ``solve_ivp(method="LSODA")`` with located events, one pass while these
# pages were built; the study makes seven, with python-control and diffrax beside it.
from softstart_studies.benchmarks.starts import DUELS, BenchmarkStarts

result = BenchmarkStarts(DUELS[:3], passes=1).run(None, lambda doing: None)
figure = result.figures["benchmark-starts-ratios"]
figure.set_label("How many starts softstart makes in the time of one of LSODA's.")

# %%
# The largest difference in K_dyn between the two:
table = result.tables[0]
for row in table.rows:
    told = dict(zip(table.columns, row, strict=True))
    print(told["strategy"], told["peer"], told["K_dyn diff."])

# %%
# All contenders: ``make benchmark``; what is compared with what is on :doc:`/benchmarks`.
