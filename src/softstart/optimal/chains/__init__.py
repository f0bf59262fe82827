"""Optimal starts of chains, through several gaps."""
