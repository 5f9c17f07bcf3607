"""``dynx compare``: two rollouts, how far apart they are, and why."""
