"""How well faults are told from attacks: `python -m tests.benchmarks.causes --into FOLDER [--attacks]`.

Each fault lasts through the frames of a drive, each attack is drawn anew for every frame: on each sensor in turn, of
streets on the LiDAR and one camera. `judged_drives` says how they are judged and counted. Of faults `right cause`
should be all and `attacked` none, of attacks `attacked` all, `others` and `suspect` none. Each needs a folder of its
own.
"""

import sys
from collections.abc import Iterator, Sequence

from auditor.model.frames import Frame
from auditor.model.rig import LIDAR, Rig
from tests.benchmarks.judged_drives import run
from tests.benchmarks.lasting_faults import CLEAN, Happening, attacks, faults

ATTACKS = "--attacks"


def of_faults(kept: Sequence[Frame], rig: Rig, seed: int, *, each: bool) -> Iterator[Happening]:
    """Clean frames, and every fault."""
    yield Happening(CLEAN, None, None, kept)
    yield from _on_chosen(faults(kept, rig), rig, seed, each=each)


def of_attacks(kept: Sequence[Frame], rig: Rig, seed: int, *, each: bool) -> Iterator[Happening]:
    """Clean frames, and every attack."""
    yield Happening(CLEAN, None, None, kept)
    yield from _on_chosen(attacks(kept, rig), rig, seed, each=each)


def _on_chosen(happened: Iterator[Happening], rig: Rig, seed: int, *, each: bool) -> Iterator[Happening]:
    chosen = {None, LIDAR, rig.cameras[seed % len(rig.cameras)].number}
    return (one for one in happened if each or one.sensor in chosen)


if __name__ == "__main__":
    attacked = ATTACKS in sys.argv
    sys.argv = [word for word in sys.argv if word != ATTACKS]
    run(__doc__ or "", of_attacks if attacked else of_faults, successive=not attacked)
