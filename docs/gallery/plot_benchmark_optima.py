"""The same optimum by three methods
=================================

The start with the lowest peak shaft torque within a given time, computed by the three methods of softstart:
closed form, successive linear programs on the exact start, and collocation with CasADi. The torque
of each method is replayed on the exact plant.
"""

# %%
# Crane drive of [G], gap 0.5 rad, to 60 rad/s within 0.2883 s. The study also includes the same problem
# written plainly in CasADi, and a shorter start time.
from softstart_studies.benchmarks.optima import BenchmarkOptima

methods = ("closed-form", "descent", "collocation")
study = BenchmarkOptima(methods, start_times=[0.2883], repetitions=0)
result = study.run(None, lambda doing: None)
figure = result.figures["benchmark-optima-answers"]
figure.set_label("K_dyn on the exact plant over computing time, by method.")

# %%
# As a table:
table = result.tables[0]
print(" | ".join(table.columns))
for row in table.rows:
    print(" | ".join(str(cell) for cell in row))

# %%
# The whole study: ``make benchmark``; for the method see :doc:`/benchmarks`.
