"""What a pickle says, of which nothing is carried out, and the columns of a table that pandas pickled.

A pickle is a program. Python's own reader imports what it names and calls it with what it likes; it also allocates by
numbers that are not checked, and hashes what is nested without end. Here a name stays a name, a call a `PickledCall`
with arguments, keys are text, and the steps are counted. Format: the standard library's pickletools.

A table is a DataFrame with a BlockManager: the names of its columns, and blocks, each an array of some of them. It is
the state of the manager up to pandas 1.2 (the blocks stand below the version of that layout, 0.14.1), and what the
manager is made of from 1.3 on. An array is numpy's; of those of text only names are read.
"""

import pickletools
import warnings
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

_MOST_STEPS = 10_000
"""Steps of a pickle. A table has 200 with 2 for each column: its numbers are a few long strings of bytes."""


@dataclass(eq=False)
class Name:
    """What a pickle would import: its module and its name, with a dot between them."""

    full: str


@dataclass(eq=False)
class PickledCall:
    """What a pickle would make by a call; its state is given to it by a later step."""

    name: str
    args: tuple[Any, ...]
    state: Any = None


def said_by(data: bytes, names: frozenset[str]) -> Any:  # noqa: ANN401  # what pickles hold
    """What a pickle holds, one thing: of numbers, text, bytes, None, lists, tuples, dicts, `Name` and `PickledCall`.

    Raises ValueError where it is no whole pickle, has steps that tables do not need, or a name that is not in `names`.
    """
    reading = _Reading(names)
    try:
        for number, (step, argument, _) in enumerate(_steps(data)):
            if number == _MOST_STEPS:
                raise ValueError(f"its pickle has more than {_MOST_STEPS} steps")
            reading.take(step.name, argument)
        [only] = reading.stack
    except (IndexError, KeyError, TypeError, AttributeError, OverflowError) as error:
        raise ValueError(f"its pickle is ill-formed ({type(error).__name__})") from error
    return only


def _steps(data: bytes) -> Iterator[tuple[pickletools.OpcodeInfo, Any, int | None]]:
    """The steps with their arguments. Raises ValueError."""
    steps = pickletools.genops(data)
    while True:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of odd escapes in what is damaged
            step = next(steps, None)
        if step is None:
            return
        yield step


class _Reading:
    """The stack and the memo of a pickle as its steps are taken."""

    def __init__(self, names: frozenset[str]) -> None:
        self.stack: list[Any] = []
        self._names = names
        self._below: list[list[Any]] = []
        self._memo: dict[int, Any] = {}

    def take(self, step: str, argument: Any) -> None:  # noqa: ANN401  # a number, text or bytes
        """Take one step. Raises ValueError, or what a wrong stack raises."""
        if step in _VALUES:
            self.stack.append(argument)
        elif step in _MAKES:
            self.stack.append(_MAKES[step]())
        elif step in _STEPS:
            _STEPS[step](self, argument)
        elif step not in _NOTHING:
            raise ValueError(f"its pickle has the step {step}, which no table needs")

    def mark(self, _: object) -> None:
        self._below.append(self.stack)
        self.stack = []

    def _above_mark(self) -> list[Any]:
        above, self.stack = self.stack, self._below.pop()
        return above

    def tuple_above_mark(self, _: object) -> None:
        above = self._above_mark()
        self.stack.append(tuple(above))

    def tuple_of(self, count: int) -> None:
        if len(self.stack) < count:
            raise IndexError
        self.stack[-count:] = [tuple(self.stack[-count:])]

    def append(self, items: list[Any]) -> None:
        _of(self.stack[-1], list).extend(items)

    def set_items(self, items: list[Any]) -> None:
        pairs = zip(items[::2], items[1::2], strict=True)
        _of(self.stack[-1], dict).update((_of(key, str), value) for key, value in pairs)

    def append_above_mark(self, _: object) -> None:
        self.append(self._above_mark())

    def set_items_above_mark(self, _: object) -> None:
        self.set_items(self._above_mark())

    def append_one(self, _: object) -> None:
        self.append([self.stack.pop()])

    def set_one(self, _: object) -> None:
        value, key = self.stack.pop(), self.stack.pop()
        self.set_items([key, value])

    def put(self, place: int | None) -> None:
        self._memo[len(self._memo) if place is None else place] = self.stack[-1]

    def get(self, place: int) -> None:
        self.stack.append(self._memo[place])

    def named(self, written: str | None) -> None:
        """A name that is written with a blank in it, or is the two texts on the stack."""
        name, module = (self.stack.pop(), self.stack.pop()) if written is None else reversed(written.split(" "))
        full = f"{_of(module, str)}.{_of(name, str)}".replace("__builtin__.", "builtins.", 1)
        if full not in self._names:
            raise ValueError(f"its pickle names {full[:80]!a}, which is no part of a table")
        self.stack.append(Name(full))

    def call(self, _: object) -> None:
        arguments, name = _of(self.stack.pop(), tuple), _of(self.stack.pop(), Name)
        self.stack.append(PickledCall(name.full, arguments))

    def give_state(self, _: object) -> None:
        state = self.stack.pop()
        _of(self.stack[-1], PickledCall).state = state


def _of(value: Any, kind: type) -> Any:  # noqa: ANN401  # what pickles hold
    """The value. Raises TypeError where it is of another kind."""
    if not isinstance(value, kind):
        raise TypeError
    return value


_VALUES = frozenset(
    {"BININT", "BININT1", "BININT2", "LONG1", "BINFLOAT", "SHORT_BINUNICODE", "BINUNICODE", "BINUNICODE8"}
    | {"SHORT_BINBYTES", "BINBYTES", "BINBYTES8", "BYTEARRAY8"}
)
_NOTHING = frozenset({"PROTO", "FRAME", "READONLY_BUFFER", "STOP"})
_MAKES: dict[str, Callable[[], Any]] = {
    "NONE": lambda: None,
    "NEWTRUE": lambda: True,
    "NEWFALSE": lambda: False,
    "EMPTY_LIST": list,
    "EMPTY_DICT": dict,
    "EMPTY_TUPLE": tuple,
}
_STEPS: dict[str, Callable[[_Reading, Any], None]] = {
    "MARK": _Reading.mark,
    "TUPLE": _Reading.tuple_above_mark,
    "TUPLE1": lambda reading, _: reading.tuple_of(1),
    "TUPLE2": lambda reading, _: reading.tuple_of(2),
    "TUPLE3": lambda reading, _: reading.tuple_of(3),
    "APPEND": _Reading.append_one,
    "APPENDS": _Reading.append_above_mark,
    "SETITEM": _Reading.set_one,
    "SETITEMS": _Reading.set_items_above_mark,
    "MEMOIZE": _Reading.put,
    "BINPUT": _Reading.put,
    "LONG_BINPUT": _Reading.put,
    "BINGET": _Reading.get,
    "LONG_BINGET": _Reading.get,
    "GLOBAL": _Reading.named,
    "STACK_GLOBAL": _Reading.named,
    "REDUCE": _Reading.call,
    "NEWOBJ": _Reading.call,
    "BUILD": _Reading.give_state,
}


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
    if not isinstance(frame, PickledCall) or frame.name not in _TABLES:
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
    if isinstance(places, PickledCall) and places.name == _SLICE:
        start, stop, step = (_whole(number) for number in places.args)
        return range(start, stop, step)[:_MOST_COLUMNS]
    numbers = _numbers(places)
    if numbers.ndim != 1 or numbers.dtype.kind not in "iu":
        raise ValueError("a block of its table does not say which columns it has")
    return [_whole(int(number)) for number in numbers[:_MOST_COLUMNS]]


def _names(data: Any) -> list[str]:  # noqa: ANN401  # what pickles hold
    """The names of columns: an array of objects, whose content is a list."""
    if not isinstance(data, PickledCall) or data.name not in _ARRAYS or not isinstance(data.state[4], list):
        raise ValueError("its columns have no names, or are named by strings of pandas 3")
    return [name if isinstance(name, str) else "" for name in data.state[4][:_MOST_COLUMNS]]


def _numbers(array: Any) -> NDArray[Any]:  # noqa: ANN401  # what pickles hold
    """An array of numbers, as a view of its bytes, of exactly as many as it declares."""
    if isinstance(array, PickledCall) and array.name in _ARRAYS:
        _, shape, dtype, fortran, data = array.state
        order = "F" if fortran else "C"
    elif isinstance(array, PickledCall) and array.name in _BUFFERS:
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
    if isinstance(data, PickledCall) and data.name == "builtins.bytearray":
        [data] = data.args
    if isinstance(data, PickledCall) and data.name == _TEXT_AS_BYTES:
        text, encoding = data.args
        if not isinstance(text, str) or encoding != "latin1":
            raise ValueError("its table has an array that is no text of bytes")
        return text.encode("latin1")
    if isinstance(data, bytes | bytearray):
        return data
    raise ValueError("its table has an array without bytes")


def _made(value: Any, name: str) -> PickledCall:  # noqa: ANN401  # what pickles hold
    """What a pickle makes by that name. Raises ValueError."""
    if not isinstance(value, PickledCall) or value.name != name:
        raise ValueError(f"its pickle has no {name.rpartition('.')[2]} where a table has one")
    return value


def _whole(number: Any) -> int:  # noqa: ANN401  # what pickles hold
    if type(number) is not int or not 0 <= number < 2**32:
        raise ValueError("its table has a size or place that is none")
    return number
