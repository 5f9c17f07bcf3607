"""Planted defects: each is put into dynx alone, and a named test must fail because of it."""
