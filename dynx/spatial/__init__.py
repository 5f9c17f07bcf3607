"""SO(3), SE(3) and rigid-body inertia: functions over arrays with leading batch axes."""
