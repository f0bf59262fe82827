"""Speed of starts and of optima beside scipy, python-control and CasADi, as ratios of one run."""
