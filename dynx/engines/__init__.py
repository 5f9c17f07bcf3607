"""Foreign engines, each imported in exactly one file, with the line that says how to install it."""
