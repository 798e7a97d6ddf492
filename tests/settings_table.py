"""The table of docs/settings.md, made from the settings: `python -m tests.settings_table` writes it."""

from collections.abc import Iterator
from dataclasses import Field
from pathlib import Path

from auditor.model.settings import Criteria, MeasureSettings, about, choices, settings_of, value_type

DOCUMENT = Path(__file__).resolve().parent.parent / "docs" / "settings.md"

_HEAD = "| option | keyword | values | default |\n|---|---|---|---|\n"
_KINDS = {bool: "flag", Path: "path", tuple: "texts", str: "text", int: "whole number"}


def table() -> str:
    return _HEAD + "".join(f"{row}\n" for row in _rows())


def _rows() -> Iterator[str]:
    for name, setting in settings_of(Criteria, MeasureSettings).items():
        flag = about(setting).flag or name.replace("_", "-")
        option = f"-{flag}" if len(flag) == 1 else f"--{flag}"
        yield f"| `{option}` | `{name}` | {_values(setting)} | {_default(setting)} |"


def _values(setting: Field) -> str:
    shown, kind = about(setting), value_type(setting)
    if texts := choices(setting):
        return ", ".join(f"`{text}`" for text in texts)
    words = [_KINDS.get(kind, "number"), *([shown.unit] if shown.unit else [])]
    if shown.least is not None:
        words.append(f"{'above' if shown.above_least else 'from'} {shown.least}")
    if shown.most is not None:
        words.append(f"to {shown.most}")
    return ", ".join(words)


def _default(setting: Field) -> str:
    words = about(setting).default_in_words
    if words is not None:
        return words
    return "none" if setting.default in (None, ()) else "off" if setting.default is False else f"`{setting.default}`"


if __name__ == "__main__":
    text = DOCUMENT.read_text(encoding="utf-8")
    before, _, rest = text.partition(_HEAD)
    after = rest[rest.index("\n\n") + 1 :]
    DOCUMENT.write_text(before + table() + after, encoding="utf-8")
