"""The linear view of a controller that runs: its loop in contact, margins, and limit cycles in the gap.

`sampled_start` runs the start on the exact plant and keeps every sample; `differences` takes the derivative
of a controller's step; `realisation` leaves out what the loop does not move or show; `sampled_plant` is the
drive at the sample instants; `operating_point` chooses where to look, by what the exact plant does;
`assembly` puts the loop together; `response`, `margins`, `delay_margin` and `modes` read it; `dead_zone` is
the describing function of the gap, `harmonic_balance` foretells limit cycles, `cycle_check` lets the exact
plant answer; `view` joins them, `telling` and `pictures` show them.
"""
