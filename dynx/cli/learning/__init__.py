"""``dynx env``, ``dynx train`` and ``dynx play``."""
