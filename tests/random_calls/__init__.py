"""Random calls of everything public, with arguments of every wrong kind."""
