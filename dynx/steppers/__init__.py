"""What moves: the interface of an engine that steps a scene, and the scene in numbers that it is given."""
