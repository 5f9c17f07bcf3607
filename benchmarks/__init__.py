"""Benchmarks of dynx: ``pytest benchmarks``. Each one checks the result before it times it."""
