"""Tasks of a control engineer who knows PyBullet."""
