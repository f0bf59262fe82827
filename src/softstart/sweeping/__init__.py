"""Sweeps: the starts of a whole grid, of any size, in memory or chunk by chunk on disk.

`sweep` (entry.py) reads the grid and cuts it into chunks (grid.py), refuses what is impossible and computes
the starts of each chunk (compute.py) in threads, processes or on a cluster (softstart.parallel). store.py
keeps them in memory or in a Zarr folder, whose list of finished chunks, with checksums of their values, says
what is left to compute after any end. summary.py and softstart.views.sweeps read results piece by piece.
"""
