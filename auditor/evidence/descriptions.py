"""What a user says of a model of their own, in a TOML file beside it: `model.toml` for `model.onnx`."""

import dataclasses
import hashlib
import math
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from auditor.errors import SettingError


def read_model_file(path: Path) -> bytes:
    """The bytes of a model; raises SettingError where there are none."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise SettingError(error.strerror or str(error), where=path, remedy="name a model's file") from error


def sha256(content: bytes) -> str:
    """The hash that tells one model from another."""
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


def fields_of(path: Path, kind: type[Any], table: object) -> dict[str, Any]:
    """A table of the file as arguments of a dataclass, lists as tuples. Raises SettingError for unknown names."""
    known = [field.name for field in dataclasses.fields(kind)]
    if not isinstance(table, dict) or not set(table) <= set(known):
        odd = ", ".join(sorted(set(table) - set(known))) if isinstance(table, dict) else repr(table)
        raise SettingError(f"{odd} is not known here", where=path, remedy=f"use: {', '.join(known)}")
    return {name: tuple(value) if isinstance(value, list) else value for name, value in table.items()}


def refuse(path: Path, rules: Iterable[tuple[str, bool, str]]) -> None:
    """Raises SettingError for the first rule that does not hold: TOML has types of its own, and nobody checked them.

    Each is the name of a value, whether it is sensible, and what it is meant to be.
    """
    for name, sensible, meant in rules:
        if not sensible:
            raise SettingError(f"{name} makes no sense", where=path, remedy=f"it is {meant}")


def is_name(value: object) -> bool:
    """True for a text that is not empty."""
    return isinstance(value, str) and bool(value)


def is_whole(value: object) -> bool:
    """True for a positive whole number."""
    return isinstance(value, int) and not isinstance(value, bool) and value > 0


def are_numbers(values: object, counts: Iterable[int], *, positive: bool = False) -> bool:
    """True for a tuple of finite numbers, as many as one of `counts`."""
    if not isinstance(values, tuple) or len(values) not in counts:
        return False
    finite = all(isinstance(value, int | float) and math.isfinite(value) for value in values)
    return finite and (not positive or min(values) > 0)
