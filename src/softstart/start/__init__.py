"""Starts of a drive: `simulation` runs them, `run` and `batch` hold what comes out, `metrics` judges it."""
