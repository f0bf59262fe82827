"""The same optimum by three methods
=================================

The gentlest start within a given time, by softstart's three methods: the closed form, a linear program
searched over the instant of contact, and collocation with CasADi. Whatever a method claims, its torque is
replayed on the exact plant.
"""

# %%
# Crane drive of [G], gap 0.5 rad, to 60 rad/s within 0.2883 s. The study lays rockit, dymos and GEKKO
# beside them, where they are installed, and asks for a quicker start, too.
from softstart_studies.benchmarks.optima.study import BenchmarkOptima

methods = ("closed-form", "lp", "collocation")
study = BenchmarkOptima(methods, start_times=[0.2883], repetitions=0, guesses=())
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
# All contenders: ``make benchmark``; what is compared with what is on :doc:`/benchmarks`.
