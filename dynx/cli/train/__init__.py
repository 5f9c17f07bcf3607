"""``dynx train``: reinforcement learning on a task, with checkpoints."""
