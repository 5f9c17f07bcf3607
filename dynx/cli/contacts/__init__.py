"""``dynx contacts``: how far each engine is from mechanics where bodies touch."""
