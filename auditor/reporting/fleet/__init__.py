"""The index of a fleet: what was not audited, vehicles by days, and incidents by severity."""
