"""Boxes, rays and distances of the shapes of a world, computed by dynx, the same for every engine."""
