"""How well faults are told from attacks: `python -m tests.benchmarks.causes --into FOLDER [--attacks]`.

Each fault lasts through the frames of a drive, each attack is drawn anew for every frame; on each sensor in turn, of
streets too. `judged_drives` says how they are judged and counted. Of faults `right cause` should be all and `accused`
none, of attacks `accused` all, `others` and `suspect` none. Faults and attacks need folders of their own.
"""

import sys
from collections.abc import Iterator, Sequence

from auditor.model.frames import Frame
from auditor.model.rig import Rig
from tests.benchmarks.judged_drives import run
from tests.benchmarks.lasting_faults import CLEAN, Happening, attacks, faults

ATTACKS = "--attacks"


def all_faults(kept: Sequence[Frame], rig: Rig, seed: int, *, each: bool) -> Iterator[Happening]:
    """Clean frames, and every fault."""
    del seed, each
    yield Happening(CLEAN, None, None, kept)
    yield from faults(kept, rig)


def all_attacks(kept: Sequence[Frame], rig: Rig, seed: int, *, each: bool) -> Iterator[Happening]:
    """Clean frames, and every attack."""
    del seed, each
    yield Happening(CLEAN, None, None, kept)
    yield from attacks(kept, rig)


if __name__ == "__main__":
    attacked = ATTACKS in sys.argv
    sys.argv = [word for word in sys.argv if word != ATTACKS]
    run(__doc__ or "", all_attacks if attacked else all_faults, successive=not attacked)
