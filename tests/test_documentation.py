"""The documents say what the program does."""

import re
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from auditor.cli import VERBS, auditor

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text()


def command_of(verb: str) -> click.Command:
    command = auditor.get_command(click.Context(auditor), verb)
    assert command is not None
    return command


def parameters_of(verb: str) -> list[click.Parameter]:
    """Those of the verb, and of its own verbs where it has some."""
    command = command_of(verb)
    below = command.commands.values() if isinstance(command, click.Group) else ()
    return [parameter for one in (command, *below) for parameter in one.params]


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help_with_an_example_that_names_known_options(verb: str) -> None:
    shown = CliRunner().invoke(auditor, [verb, "--help"])
    assert shown.exit_code == 0
    examples = [line.strip() for line in shown.output.splitlines() if line.strip().startswith("auditor ")]
    assert any(line.startswith(f"auditor {verb}") for line in examples)
    known = {option for parameter in parameters_of(verb) for option in (*parameter.opts, *parameter.secondary_opts)}
    for line in examples:
        if line.startswith(f"auditor {verb}"):
            assert set(re.findall(r"(?<=\s)--?[a-z][a-z-]*", line)) <= known, line


@pytest.mark.parametrize("verb", VERBS)
def test_every_option_is_explained(verb: str) -> None:
    for parameter in parameters_of(verb):
        if isinstance(parameter, click.Option) and parameter.name != "help":
            assert parameter.help, parameter.opts


def test_the_readme_and_the_group_help_name_every_verb_and_no_other() -> None:
    assert set(re.findall(r"^\| `auditor ([\w-]+)`", README, re.MULTILINE)) == set(VERBS)
    assert set(re.findall(r"^  ([\w-]+)  ", CliRunner().invoke(auditor, ["--help"]).output, re.MULTILINE)) >= set(VERBS)


def test_the_readmes_first_screen_has_one_command_for_the_demo_and_one_for_the_tests() -> None:
    first_screen = README.split("## ")[0]
    commands = re.findall(r"^python3 .*$", first_screen, re.MULTILINE)
    assert [("auditor demo" in line, "pytest" in line) for line in commands] == [(True, False), (False, True)]


def test_help_needs_none_of_the_heavy_libraries() -> None:
    heavy = ("cv2", "numpy", "pyarrow", "duckdb", "rosbags", "mcap", "torch", "rich", "jinja2")
    program = (
        f"import sys; from auditor.cli import run; run(['--help']); sys.exit(bool(set({heavy}) & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_no_placeholder_is_left_in_the_documents() -> None:
    for path in (
        ROOT / "README.md",
        *sorted((ROOT / "docs").glob("*.md")),
        ROOT / "CHANGELOG.md",
        ROOT / "CONTRIBUTING.md",
    ):
        assert "@@" not in path.read_text(), path
