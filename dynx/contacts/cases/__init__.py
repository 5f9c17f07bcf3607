"""Cases of dynx, those of one kind of contact in one module."""
