"""Sweeps: the starts of a whole grid, of any size, in memory or chunk by chunk on disk.

`sweep` (entry.py) reads the grid (axes.py) and refuses what cannot be (checking.py), cuts it into chunks
(plan.py), lets processes (workers.py) or a cluster (cluster.py) compute them (starts.py) and keeps what is
finished in a Zarr folder (store.py) from which it goes on after any end. summary.py and pictures.py read
such results piece by piece.
"""
