"""Declarations of the commands: their options and help, which import nothing heavy."""
