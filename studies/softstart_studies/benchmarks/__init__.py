"""Speed and memory of softstart beside named peers: the same starts, the same end, in one run, as ratios."""
