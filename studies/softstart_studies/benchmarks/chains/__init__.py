"""The exact start of a chain beside scipy's LSODA."""

from softstart_studies.benchmarks.chains.study import BenchmarkChains

__all__ = ["BenchmarkChains"]
