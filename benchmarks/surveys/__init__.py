"""Surveys over many files, robots and scenes whose figures the docs state; not run by the tests."""
