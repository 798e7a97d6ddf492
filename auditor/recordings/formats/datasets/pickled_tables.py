"""Columns of a table that pandas pickled, without pandas, and without anything of the pickle being carried out.

A table is a DataFrame with a BlockManager: the names of its columns, and blocks, each an array of some of them. It is
the state of the manager up to pandas 1.2 (the blocks stand below the version of that layout, 0.14.1), and what the
manager is made of from 1.3 on. An array is numpy's; of those of text only names are read.
"""

from collections.abc import Collection, Iterator
from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from auditor.recordings.formats.datasets.pickles import Made, said_by

_TABLES = frozenset({"pandas.core.frame.DataFrame", "pandas.DataFrame"})
_MANAGER, _BLOCK = "pandas.core.internals.managers.BlockManager", "pandas._libs.internals._unpickle_block"
_LAYOUT = "0.14.1"
_INDEX, _SLICE, _TEXT_AS_BYTES, _DTYPE = (
    "pandas.core.indexes.base._new_Index",
    "builtins.slice",
    "_codecs.encode",
    "numpy.dtype",
)
_ARRAYS = frozenset({"numpy.core.multiarray._reconstruct", "numpy._core.multiarray._reconstruct"})
_BUFFERS = frozenset({"numpy.core.numeric._frombuffer", "numpy._core.numeric._frombuffer"})
_INDEXES = {f"pandas.core.indexes.base.{name}" for name in ("Index", "Int64Index", "UInt64Index", "RangeIndex")}
_INDEXES |= {f"pandas.core.indexes.numeric.{name}" for name in ("Int64Index", "UInt64Index", "Float64Index")}
_INDEXES |= {"pandas.core.indexes.range.RangeIndex", "pandas.Index", "pandas.RangeIndex"}
NAMES = (
    frozenset({_MANAGER, _BLOCK, _INDEX, _SLICE, _TEXT_AS_BYTES, _DTYPE, "numpy.ndarray", "builtins.bytearray"})
    | (_TABLES | _ARRAYS | _BUFFERS)
    | _INDEXES
)
"""All that a pickled table of numbers names, by pandas 0.25 to 2 and numpy 1 and 2."""

_KINDS, _BYTE_ORDERS = frozenset("fiub"), frozenset("<>|=")
_MOST_COLUMNS = 100


class _Block(NamedTuple):
    """The array of a block, and the place of each of its rows among the table's columns."""

    values: Any
    places: range | list[int]


def columns_of(data: bytes, wanted: Collection[str]) -> dict[str, NDArray[Any]]:
    """Those of the wanted columns that a pickled table has, all of one length. Raises ValueError.

    They are views of the bytes of the pickle: no memory is taken that its length does not bound.
    """
    try:
        names, blocks = _table(said_by(data, NAMES))
        columns = dict(_columns(names, blocks, wanted))
    except (KeyError, TypeError, AttributeError, IndexError, OverflowError) as error:
        raise ValueError(f"its pickle is no table of numbers ({type(error).__name__})") from error
    if len({len(column) for column in columns.values()}) > 1:
        raise ValueError("its columns have several lengths")
    return columns


def _table(frame: Any) -> tuple[list[str], list[_Block]]:  # noqa: ANN401  # what pickles hold
    """The names of the columns, and the blocks."""
    if not isinstance(frame, Made) or frame.name not in _TABLES:
        raise ValueError("its pickle is no table")
    manager = _made(frame.state["_mgr"] if "_mgr" in frame.state else frame.state["_data"], _MANAGER)
    if manager.state is not None:
        layout = manager.state[3][_LAYOUT]
        axes, blocks = layout["axes"], [(block["values"], block["mgr_locs"]) for block in layout["blocks"]]
    else:
        made, axes = manager.args[:2]
        blocks = [_made(block, _BLOCK).args[:2] for block in made]
    if len(blocks) > _MOST_COLUMNS:
        raise ValueError(f"its table has {len(blocks)} blocks")
    names = _names(_made(axes[0], _INDEX).args[1]["data"])
    return names, [_Block(values, _places(places)) for values, places in blocks]


def _columns(names: list[str], blocks: list[_Block], wanted: Collection[str]) -> Iterator[tuple[str, NDArray[Any]]]:
    for block in blocks:
        here = [(row, names[place]) for row, place in enumerate(block.places) if names[place] in wanted]
        if here:
            values = _numbers(block.values)
            if values.ndim != 2 or len(values) != len(block.places):
                raise ValueError("a block of its table has another number of columns than it says")
            yield from ((name, values[row]) for row, name in here)


def _places(places: Any) -> range | list[int]:  # noqa: ANN401  # what pickles hold
    if isinstance(places, Made) and places.name == _SLICE:
        start, stop, step = (_whole(number) for number in places.args)
        return range(start, stop, step)[:_MOST_COLUMNS]
    numbers = _numbers(places)
    if numbers.ndim != 1 or numbers.dtype.kind not in "iu":
        raise ValueError("a block of its table does not say which columns it has")
    return [_whole(int(number)) for number in numbers[:_MOST_COLUMNS]]


def _names(data: Any) -> list[str]:  # noqa: ANN401  # what pickles hold
    """The names of columns: an array of objects, whose content is a list."""
    if not isinstance(data, Made) or data.name not in _ARRAYS or not isinstance(data.state[4], list):
        raise ValueError("its columns have no names, or are named by strings of pandas 3")
    return [name if isinstance(name, str) else "" for name in data.state[4][:_MOST_COLUMNS]]


def _numbers(array: Any) -> NDArray[Any]:  # noqa: ANN401  # what pickles hold
    """An array of numbers, as a view of its bytes, of exactly as many as it declares."""
    if isinstance(array, Made) and array.name in _ARRAYS:
        _, shape, dtype, fortran, data = array.state
        order = "F" if fortran else "C"
    elif isinstance(array, Made) and array.name in _BUFFERS:
        data, dtype, shape, order = array.args
    else:
        raise ValueError("its table has a column that is no array of numpy")
    kind, sizes, held = _dtype(dtype), tuple(_whole(size) for size in shape), _bytes(data)
    if not 1 <= len(sizes) <= 2 or prod(sizes) * kind.itemsize != len(held):
        raise ValueError(f"an array of its table has {len(held)} bytes, and declares others")
    return np.frombuffer(held, kind).reshape(sizes, order="F" if order == "F" else "C")


def _dtype(dtype: Any) -> np.dtype[Any]:  # noqa: ANN401  # what pickles hold
    code, order = _made(dtype, _DTYPE).args[0], dtype.state[1] if dtype.state else "="
    if not isinstance(code, str) or code[:1] not in _KINDS or code[1:] not in {"1", "2", "4", "8"}:
        raise ValueError("its table has a column that is no number")
    if code in {"f1", "b2", "b4", "b8"} or not isinstance(order, str) or order not in _BYTE_ORDERS:
        raise ValueError("its table has numbers of a kind that numpy does not have")
    return np.dtype(f"{order}{code}")


def _bytes(data: Any) -> bytes | bytearray:  # noqa: ANN401  # what pickles hold
    """The content of an array: bytes; in protocol 2, which has none, text whose characters are bytes."""
    if isinstance(data, Made) and data.name == "builtins.bytearray":
        [data] = data.args
    if isinstance(data, Made) and data.name == _TEXT_AS_BYTES:
        text, encoding = data.args
        if not isinstance(text, str) or encoding != "latin1":
            raise ValueError("its table has an array that is no text of bytes")
        return text.encode("latin1")
    if isinstance(data, bytes | bytearray):
        return data
    raise ValueError("its table has an array without bytes")


def _made(value: Any, name: str) -> Made:  # noqa: ANN401  # what pickles hold
    """What a pickle makes by that name. Raises ValueError."""
    if not isinstance(value, Made) or value.name != name:
        raise ValueError(f"its pickle has no {name.rpartition('.')[2]} where a table has one")
    return value


def _whole(number: Any) -> int:  # noqa: ANN401  # what pickles hold
    if type(number) is not int or not 0 <= number < 2**32:
        raise ValueError("its table has a size or place that is none")
    return number
