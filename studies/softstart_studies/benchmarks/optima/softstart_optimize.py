"""softstart itself: the closed form, the descent of `optimize`, and its CasADi statement."""

from __future__ import annotations

from softstart_studies.benchmarks.optima.task import Answer, Task, crane


def solve(task: Task, method: str = "closed-form") -> Answer:
    """Least peak torque by one of softstart's methods."""
    from softstart.optimal.optimize import searched
    from softstart.optimal.problem import Problem
    from softstart.optimal.pulse_coast_hold import solve as closed_form

    problem = Problem(crane(), task.start_time)
    if method == "closed-form":
        profile, end, claimed = closed_form(problem)
    elif method == "descent":
        found = searched(problem)
        if found is None:
            raise RuntimeError("no start was found.")
        _, best, profile = found
        claimed, end = best.peak / problem.base_torque, best.end
    else:
        from softstart import simulate
        from softstart.optimal.statement import solve as nonlinear

        drive = crane()  # whose strategy gives the order of contacts: one
        run = simulate(drive, "pulse-coast-hold", task.start_time + float(drive.elastic_period))
        claim = nonlinear(problem, run, straight=True)
        profile, claimed, end = claim.profile, claim.value, claim.end_time
    return Answer(claimed, tuple(profile.time.tolist()), tuple(profile.torque.tolist()), end)
