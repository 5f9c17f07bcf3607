"""``dynx contacts``: errors of each engine where bodies touch, against closed forms, and their causes."""
