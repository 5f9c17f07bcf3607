"""Scripts of dynx that run in the browser."""
