"""Why two rollouts part: distance over time, and differences of their scenarios, proved by reruns."""
