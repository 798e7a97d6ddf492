"""Single flipped bits in the files of a store, drawn from a seed, and put back."""

import os
import random
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Flip:
    """One bit of one file; with `silent` the file's times are set back."""

    path: Path
    bit: int
    silent: bool


def tables_and_pictures(folder: Path) -> list[Path]:
    return sorted([*folder.glob("*/*.parquet"), *folder.glob("pictures/*/*")])


def draw_flips(folder: Path, count: int, seed: int = 0) -> Iterator[Flip]:
    """`count` flips, equally many in each file as far as that goes; every other one is silent."""
    draw, paths = random.Random(seed), tables_and_pictures(folder)
    for number in range(count):
        path = paths[number % len(paths)]
        yield Flip(path, draw.randrange(8 * path.stat().st_size), silent=bool((number // len(paths)) % 2))


@contextmanager
def flipped(flip: Flip) -> Iterator[str]:
    """The place in the store of a file with one bit flipped, which is put back at the end of the block."""
    before, content = flip.path.stat(), bytearray(flip.path.read_bytes())
    content[flip.bit // 8] ^= 1 << flip.bit % 8
    _write(flip.path, content)
    if flip.silent:
        os.utime(flip.path, ns=(before.st_atime_ns, before.st_mtime_ns))
    try:
        yield "/".join(flip.path.parts[-3 if "pictures" in flip.path.parts else -2 :])
    finally:
        content[flip.bit // 8] ^= 1 << flip.bit % 8
        _write(flip.path, content)
        os.utime(flip.path, ns=(before.st_atime_ns, before.st_mtime_ns))


def _write(path: Path, content: bytearray) -> None:
    with path.open("r+b") as file:  # the inode stays
        file.write(content)
