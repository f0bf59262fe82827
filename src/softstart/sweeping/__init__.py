"""Sweeps: the starts of a whole grid, of any size, in memory or chunk by chunk on disk.

`sweep` (entry.py) reads the grid and cuts it into chunks (grid.py), refuses what is impossible and computes
the starts of each chunk (starts.py) in threads, processes or on a cluster (softstart.parallel), and keeps
what is finished in memory (results.py) or in a Zarr folder (store.py), from which it goes on after any end.
summary.py and softstart.views.sweeps read such results piece by piece.
"""
