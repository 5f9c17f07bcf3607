"""What dynx costs, measured: ``pytest benchmarks``. Each benchmark checks the answer before it times it."""
