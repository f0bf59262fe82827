"""Controllers and machines as C, Structured Text and FMU: what was designed here, to run elsewhere."""
