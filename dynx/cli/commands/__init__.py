"""One module per command. They import click at their head and all else when they run."""
