"""Tasks of a student who knows Python and little robotics."""
