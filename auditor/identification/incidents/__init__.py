"""From frames to incidents: a sequential test on frames, stretches of them, and the events that both make."""
