"""SO(3), SE(3) and rigid-body inertia, as plain functions over arrays with leading batch axes."""
