"""Cases of dynx, a module each."""
