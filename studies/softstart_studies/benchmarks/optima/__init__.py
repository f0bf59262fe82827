"""The same optimal start solved with softstart and with named peers, and what the exact plant makes of it."""
