"""Mutation testing: random slips in the source of dynx, and the share of them that the tests catch."""
