"""Cases of dynx, one in each module."""
