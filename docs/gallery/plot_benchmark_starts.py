"""Starts per second, compared with LSODA
======================================

softstart evaluates the motion between two events and the instant of the next event in closed form; a
general integrator needs hundreds of steps for the same curve. Both simulate the same starts to the same
end, with rates by processor time.
"""

# %%
# Constant and staged torque, compared with ``solve_ivp(method="LSODA")`` with located events, in one pass.
# The study makes seven passes and also includes chains, sampled torque and python-control.
from softstart_studies.benchmarks.starts import DUELS, BenchmarkStarts

result = BenchmarkStarts(DUELS[:3], passes=1).run(None, lambda doing: None)
figure = result.figures["benchmark-starts-ratios"]
figure.set_label("Number of starts by softstart in the time of one start by LSODA.")

# %%
# The largest difference in K_dyn between the two:
table = result.tables[0]
for row in table.rows:
    cells = dict(zip(table.columns, row, strict=True))
    print(cells["start"], cells["peer"], cells["K_dyn diff."])

# %%
# The whole study: ``make benchmark``; for the method see :doc:`/benchmarks`.
