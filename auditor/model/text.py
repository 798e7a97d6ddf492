"""Text that others wrote: names of files, topics, vehicles and sensors, and whatever else a recording says.

Any of it may hold newlines, control sequences, marks that turn the direction of writing, or bytes that are no UTF-8.
It is kept as it is, and made safe where it leaves: on a screen, on a page and in a cell of CSV.
"""

import re
import unicodedata
from collections.abc import Sequence

_UNSAFE_KINDS = frozenset({"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"})
"""Controls, marks of format (also of direction), surrogates, characters without a meaning, ends of lines."""
_SURROGATES = re.compile("[\ud800-\udfff]")
_BYTES = re.compile("[\udc80-\udcff]")
"""What Python makes of bytes, as of a file's name, that are no UTF-8."""
_FORMULA_BEGINS = tuple("=+-@\uff1d\uff0b\uff0d\uff20")
_NUMBER = re.compile(r"[+-]?\d+(\.\d*)?([eE][+-]?\d+)?")


def one_line(text: str) -> str:
    r"""Text on one line that a terminal or browser only shows: what else it could do is written out, as \n or \x1b."""
    return text if text.isascii() and text.isprintable() else "".join(map(_written_out, text))


def enumerated(names: Sequence[str]) -> str:
    """Names in words: a, b and c."""
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def first_few(names: Sequence[str], most: int) -> str:
    """The first few of some names, and how many more there are: a, b and 3 more."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def storable(text: str) -> str:
    r"""Text that UTF-8 can hold: a byte of a file name that is no UTF-8 is written out as \xff."""
    return _SURROGATES.sub(lambda found: _escape(found[0]), text)


def csv_cell(text: str) -> str:
    """Text for a cell of CSV: one line, and with an apostrophe before what a spreadsheet would take for a formula.

    Formulas begin with =, +, - or @. What is a number as a whole stays one.
    """
    safe = one_line(text)
    begins_one = safe.lstrip().startswith(_FORMULA_BEGINS) and not _NUMBER.fullmatch(safe)
    return f"'{safe}" if begins_one else safe


def _written_out(character: str) -> str:
    return _escape(character) if unicodedata.category(character) in _UNSAFE_KINDS else character


def _escape(character: str) -> str:
    if _BYTES.match(character):
        return rf"\x{character.encode('ascii', 'surrogateescape').hex()}"
    return character.encode("unicode_escape").decode()
