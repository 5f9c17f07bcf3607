"""Surfaces of shapes as triangles for the page."""
