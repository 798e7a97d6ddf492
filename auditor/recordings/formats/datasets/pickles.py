"""What a pickle says, of which nothing is carried out.

A pickle is a program. Python's own reader imports what it names and calls it with what it likes; it also allocates by
numbers that are not checked, and hashes what is nested without end. Here a name stays a name, a call stays a `Made`
with its arguments, keys are text, and the steps are counted. Format: the standard library's pickletools.
"""

import pickletools
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

_MOST_STEPS = 10_000
"""Steps of a pickle. A table has 200 with 2 for each column: its numbers are a few long strings of bytes."""


@dataclass(eq=False)
class Name:
    """What a pickle would import: its module and its name, with a dot between them."""

    full: str


@dataclass(eq=False)
class Made:
    """What a pickle would make by a call; its state is given to it by a later step."""

    name: str
    args: tuple[Any, ...]
    state: Any = None


def said_by(data: bytes, names: frozenset[str]) -> Any:  # noqa: ANN401  # what pickles hold
    """The only thing that a pickle holds: of numbers, text, bytes, None, lists, tuples, dicts, `Name` and `Made`.

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
        self.stack.append(Made(name.full, arguments))

    def give_state(self, _: object) -> None:
        state = self.stack.pop()
        _of(self.stack[-1], Made).state = state


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
