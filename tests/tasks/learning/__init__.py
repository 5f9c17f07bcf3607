"""Tasks of a reinforcement-learning researcher."""
