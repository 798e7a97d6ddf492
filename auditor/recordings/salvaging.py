"""What may be trusted of a chunk that its file's end cuts: its checksum, where it has one, cannot be checked."""

_ZEROS = bytes(512)


def is_trusted(data: bytes | memoryview) -> bool:
    """True for the data of a whole record without a run of zeros, which a crash may leave where data should be.

    Leaving out too much is no loss here: what is left out was cut, and says so.
    """
    return bytes(data).find(_ZEROS) < 0
