"""Foreign engines, each imported in one file, which names the command that installs it in its error."""
