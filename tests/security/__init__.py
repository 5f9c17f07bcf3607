"""Attacks on everything that dynx reads from strangers: files, folders, and the socket of its page."""
