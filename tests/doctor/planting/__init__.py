"""The bench of planted defects: one known cause, or two, put into robots that all engines load alike."""
