"""Other libraries that evaluate batches, as implementations beside `compiled` in the tables of benchmarks."""
