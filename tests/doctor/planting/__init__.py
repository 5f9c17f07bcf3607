"""Planted defects: one or two known causes put into robots that all engines load alike."""
