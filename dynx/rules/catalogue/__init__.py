"""The rules, a module for each subject; the docstring of a rule is its page."""
