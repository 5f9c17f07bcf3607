"""Readers of the formats of meshes, each from bytes; damaged ones raise ValueError with the reason."""
