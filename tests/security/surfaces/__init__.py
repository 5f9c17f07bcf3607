"""Attacks by what they attack; importing `every` registers all of them."""
