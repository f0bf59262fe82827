"""A million sampled starts: rate beside LSODA, memory, and what killed processes cost."""
