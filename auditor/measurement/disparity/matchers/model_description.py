"""What a user says of a model of their own, in a TOML file beside it: `model.toml` for `model.onnx`.

A kind of description is a dataclass, and so is each of its tables. TOML has types of its own that are not checked, so
fields carry rules: `divisor: Annotated[float, POSITIVE] = 255.0`. What concerns several fields is in `rules`.
"""

import dataclasses
import hashlib
import math
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from auditor.errors import SettingError
from auditor.measurement.disparity.half_resolution import grey
from auditor.model.canonical import canonical_json
from auditor.safety.budget import MAX_MODEL_BYTES


class Rule(NamedTuple):
    """Whether a value is sensible, and what it is meant to be."""

    holds: Callable[[Any], bool]
    meant: str


def one_of(*words: str) -> Rule:
    """One of a few words."""
    return Rule(lambda value: value in words, f"{', '.join(words[:-1])} or {words[-1]}")


def whole(meant: str, smallest: int = 1, largest: float = math.inf) -> Rule:
    """A whole number within limits."""
    return Rule(lambda value: type(value) is int and smallest <= value <= largest, meant)


def numbers(meant: str, *counts: int, of: Callable[[Any], bool] | None = None) -> Rule:
    """A list of numbers, as many as one of `counts`, for each of which `of` holds."""
    holds = of or NUMBER.holds
    return Rule(lambda values: isinstance(values, tuple) and len(values) in counts and all(map(holds, values)), meant)


NAME = Rule(lambda value: isinstance(value, str) and bool(value), "a name")
NAME_OR_NOTHING = Rule(lambda value: isinstance(value, str), "a name, or nothing")
NUMBER = Rule(lambda value: isinstance(value, int | float) and math.isfinite(value), "a number")
POSITIVE = Rule(lambda value: NUMBER.holds(value) and value > 0, "a positive number")
SHARE = Rule(lambda value: NUMBER.holds(value) and 0 <= value <= 1, "a number from 0 to 1")


@dataclass(frozen=True)
class ModelTable:
    """A description or one of its tables."""

    def rules(self) -> Iterator[tuple[str, bool, str]]:
        """What concerns several fields that are sensible by themselves: a name, whether it fits, what it is meant."""
        yield from ()

    def settings(self, model_sha256: str) -> str:
        """Canonical JSON of a description and of its model's hash."""
        values = dataclasses.asdict(self) | {"model_sha256": model_sha256}
        return canonical_json(values)


@dataclass(frozen=True)
class Pixels(ModelTable):
    """How the pixels of an image are shown to a network."""

    colour: Annotated[str, one_of("rgb", "bgr", "grey")] = "rgb"
    divisor: Annotated[float, POSITIVE] = 255.0
    mean: Annotated[tuple[float, ...], numbers("a list of one number, or of one a channel", 1, 3)] = (0.0,)
    deviation: Annotated[tuple[float, ...], numbers("a list like mean, all positive", 1, 3, of=POSITIVE.holds)] = (1.0,)

    def rules(self) -> Iterator[tuple[str, bool, str]]:
        """A grey image has one channel."""
        for name, values in (("mean", self.mean), ("deviation", self.deviation)):
            yield name, self.colour != "grey" or len(values) == 1, "a list of one number for grey images"

    def channels(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """(H, W, C) in the order described, from (H, W) grey or (H, W, 3) BGR."""
        if self.colour == "grey":
            return np.atleast_3d(grey(image))
        pixels = np.broadcast_to(np.atleast_3d(image), (*image.shape[:2], 3))
        return pixels[..., ::-1] if self.colour == "rgb" else pixels

    def normalised(self, pixels: NDArray[np.uint8]) -> NDArray[np.float32]:
        """(H, W, C) divided by the divisor, less the mean, then divided by the deviation."""
        divisor, mean, deviation = (np.asarray(v, np.float32) for v in (self.divisor, self.mean, self.deviation))
        return np.asarray((pixels.astype(np.float32) / divisor - mean) / deviation, dtype=np.float32)


Kind = TypeVar("Kind", bound=ModelTable)


def read_model_file(path: Path) -> bytes:
    """The bytes of a model; raises SettingError where there are none, or too many."""
    try:
        if path.stat().st_size > MAX_MODEL_BYTES:
            raise SettingError(f"it has over {MAX_MODEL_BYTES} bytes: networks are smaller", where=path)
        return path.read_bytes()
    except OSError as error:
        raise SettingError(error.strerror or str(error), where=path, remedy="name a model's file") from error


def sha256(content: bytes) -> str:
    """The hash that identifies a model."""
    return hashlib.sha256(content).hexdigest()


def read_toml(model: Path, remedy: str) -> tuple[Path, dict[str, Any]]:
    """The description beside a model, with its path. Raises SettingError where there is none that can be read."""
    path = model.with_suffix(".toml")
    try:
        return path, tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise SettingError("there is no description beside the model", where=path, remedy=remedy) from error
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise SettingError(f"no readable TOML ({error})", where=path) from error


def described(path: Path, kind: type[Kind], table: object, tables: Mapping[str, type[ModelTable]]) -> Kind:
    """What the file says as a description of a kind, whose `tables` are of these kinds by name.

    Raises SettingError for unknown names and for the first value that makes no sense.
    """
    values = _fields_of(path, kind, table)
    parts = {name: of(**_fields_of(path, of, values.get(name, {}))) for name, of in tables.items()}
    description = kind(**values | parts)
    whole_of_it: list[tuple[str, ModelTable]] = [
        ("", description),
        *((f"{name}.", part) for name, part in parts.items()),
    ]
    # Rules of several fields come last: they ask more of values that are sensible by themselves.
    for rules in (_field_rules, lambda part: part.rules()):
        for prefix, part in whole_of_it:
            for name, sensible, meant in rules(part):
                if not sensible:
                    raise SettingError(f"{prefix}{name} makes no sense", where=path, remedy=f"it is {meant}")
    return description


def _fields_of(path: Path, kind: type[ModelTable], table: object) -> dict[str, Any]:
    """A table of the file as arguments of its dataclass, lists as tuples."""
    names = [field.name for field in dataclasses.fields(kind)]
    if not isinstance(table, dict) or not set(table) <= set(names):
        odd = ", ".join(sorted(set(table) - set(names))) if isinstance(table, dict) else repr(table)
        raise SettingError(f"{odd} is not known here", where=path, remedy=f"use: {', '.join(names)}")
    return {name: tuple(value) if isinstance(value, list) else value for name, value in table.items()}


def _field_rules(part: ModelTable) -> Iterator[tuple[str, bool, str]]:
    for field in dataclasses.fields(part):
        for rule in getattr(field.type, "__metadata__", ()):
            yield field.name, rule.holds(getattr(part, field.name)), rule.meant
