"""What the priors of checks were fitted to, or chosen by, and those that several checks share."""

from auditor.model.checks.kind import PriorOf

FITTED = "fitted by benchmark prior to real drives and streets (docs/method.md)"
LOST = f"{FITTED}; a tail of 1.1, widened: 1.25, 1.4, 1.5 and 1.6 tried on streets 7000 to 7159 (docs/decisions.md)"
LIGHT = f"{FITTED}, by counting version 12; tails widened on streets 9800 to 10159 (docs/decisions.md)"
REAL = "three clean real drives and their attacks; a guard of 56 streets for the tail (docs/ablations.md)"
TAILS = f"{FITTED}; tails widened on streets 9800 to 10159, of ten seconds (docs/decisions.md)"
RANGES = "three real drives and streets 30000 to 30013, clean and attacked: widened by hand (docs/decisions.md)"
SCATTERED = "three real drives and streets 7000 to 7059: 0.07 at most, 0 nearly always (docs/decisions.md)"
IN_TIME = f"{FITTED}, of one camera by itself (docs/decisions.md)"
NO_CLEAN = "statistics that clean frames have none of (docs/decisions.md): widened by hand"
UNMATCHED = "62 clean frames of three real drives and 480 of streets 7000 to 7059: widened by hand (docs/decisions.md)"
FOREIGN = "62 clean frames of three real drives and 60 of streets 7000 to 7029: widened by hand (docs/decisions.md)"
TEXTURE = "62 clean frames of three real drives and 240 of streets 7000 to 7029: tails widened (docs/decisions.md)"

LIGHT_OF_ONE = PriorOf("light_of_one", (-2.1, 0.35, 0.35, 1.75), REAL)
SELDOM = PriorOf("seldom", (-3.93, 0.4, 0.1, 1.8), NO_CLEAN)
