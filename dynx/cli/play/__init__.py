"""``dynx play``: a trained policy, shown or judged."""
