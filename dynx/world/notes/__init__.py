"""Sentences on a world: what is amiss at its start, and the likely causes where it diverged."""
