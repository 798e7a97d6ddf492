"""The documents say what the program does."""

import ast
import inspect
import re
import shutil
import subprocess
import sys
from configparser import ConfigParser
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from ruamel.yaml import YAML

import auditor as package
from auditor import __version__
from auditor.cli import VERBS, auditor
from auditor.identification.refresh_parameters import CLEAN_DRIVE, CONDITIONS, DRIFT, GATE, INFLUENCE, TWO_SAMPLES

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
BENCHMARKS = ROOT / "tests" / "benchmarks"
NEVER_RAISE = ("rows_of", "synchronise")
"""Functions of the library that raise nothing by themselves."""
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")])


def command_of(verb: str) -> click.Command:
    command = auditor.get_command(click.Context(auditor), verb)
    assert command is not None
    return command


def parameters_of(verb: str) -> list[click.Parameter]:
    """Those of the verb, and of its own verbs where it has some."""
    command = command_of(verb)
    below = command.commands.values() if isinstance(command, click.Group) else ()
    return [parameter for one in (command, *below) for parameter in one.get_params(click.Context(one))]


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


def test_every_option_is_explained() -> None:
    options = [(verb, one) for verb in VERBS for one in parameters_of(verb) if isinstance(one, click.Option)]
    assert [(verb, one.opts) for verb, one in options if one.name != "help" and not one.help] == []


@pytest.mark.parametrize("name", [name for name in package.__all__ if inspect.isfunction(getattr(package, name))])
def test_the_library_says_of_each_function_what_it_takes_gives_and_raises(name: str) -> None:
    function = getattr(package, name)
    sections = dict(re.findall(r"^([A-Z][A-Za-z ]+)\n-{5,}\n(.*?)(?=\n\n|\Z)", inspect.getdoc(function), re.M | re.S))
    told = re.findall(r"^\*{0,2}(\w+)$", sections["Parameters"] + "\n" + sections.get("Other Parameters", ""), re.M)
    assert [one for one in inspect.signature(function).parameters if one not in told] == []
    assert {"Returns", "Yields"} & sections.keys()
    assert "Raises" in sections or name in NEVER_RAISE


def test_the_readme_and_the_group_help_name_every_verb_and_no_other() -> None:
    assert tuple(re.findall(r"^\| `auditor ([\w-]+)`", README, re.MULTILINE)) == VERBS
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


def test_the_readme_calls_the_program_where_its_first_command_installs_it() -> None:
    first_screen, own_recordings = README.split("## ")[:2]
    installed = re.search(r"(\S+/bin/auditor) demo", first_screen)
    assert installed is not None
    for block in re.findall(r"^```sh\n(.*?)^```", own_recordings, re.MULTILINE | re.DOTALL):
        for line in block.splitlines():
            assert line.startswith(f"{installed[1]} "), line


def test_no_placeholder_is_left_in_the_documents() -> None:
    assert [path.name for path in DOCUMENTS if "@@" in path.read_text(encoding="utf-8")] == []


def test_every_link_of_a_document_leads_to_a_file_that_is_there() -> None:
    targets = [
        (path, target)
        for path in DOCUMENTS
        for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", path.read_text(encoding="utf-8"))
        if "://" not in target
    ]
    assert [f"{path.name}: {target}" for path, target in targets if not (path.parent / target).exists()] == []


def test_the_lines_of_a_document_are_shorter_than_120_characters() -> None:
    lines = [
        (f"{path.name}:{number}", line)
        for path in DOCUMENTS
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
    ]
    assert [place for place, line in lines if len(line) >= 120] == []


def test_the_citation_names_this_version_and_the_paper() -> None:
    citation = YAML(typ="safe", pure=True).load(ROOT / "CITATION.cff")
    assert citation["cff-version"] == "1.2.0"
    assert citation["title"] == "auditor"
    assert citation["version"] == __version__
    (paper,) = citation["references"]
    assert f"doi:{paper['doi']}" in README
    assert [author["family-names"] for author in paper["authors"]] == re.findall(r"[A-Z]\. (\w+)[,:]", README)


def test_every_benchmark_that_a_text_names_exists() -> None:
    texts = [*DOCUMENTS, *(ROOT / "tests").rglob("*.py"), *(ROOT / "auditor").rglob("*.py")]
    named = {
        (path.name, name)
        for path in texts
        for name in re.findall(r"-m tests\.benchmarks\.(\w+)", path.read_text(encoding="utf-8"))
    }
    assert named
    assert [one for one in sorted(named) if not (BENCHMARKS / f"{one[1]}.py").exists()] == []


def test_every_benchmark_that_can_be_run_says_how() -> None:
    scripts = [path for path in BENCHMARKS.glob("*.py") if "__main__" in path.read_text(encoding="utf-8")]
    assert scripts
    docstrings = {path.stem: ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "" for path in scripts}
    assert [name for name, text in docstrings.items() if f"python -m tests.benchmarks.{name}" not in text] == []


def test_every_test_that_the_threat_model_names_exists() -> None:
    text = (ROOT / "docs" / "threat-model.md").read_text(encoding="utf-8")
    files = list((ROOT / "tests").rglob("test_*.py"))
    known = {f"{path.stem}.py" for path in files}
    known |= {name for path in files for name in re.findall(r"^def (test_\w+)", path.read_text("utf-8"), re.MULTILINE)}
    named = set(re.findall(r"\b(test_\w+(?:\.py)?)", text))
    assert named
    assert sorted(named - known) == []


def test_every_test_that_the_table_of_forms_names_exists() -> None:
    rows = (ROOT / "docs" / "forms.md").read_text(encoding="utf-8").splitlines()
    named = [found.group(1) for row in rows if (found := re.search(r"\| `([\w./]+)` \|$", row))]
    assert len(named) > 40
    for one in named:
        folder, _, name = one.rpartition("/")
        assert (ROOT / "tests" / "recordings" / folder / f"test_{name}.py").is_file(), one


PAGE = (Path(__file__).parents[1] / "docs" / "refresh.md").read_text(encoding="utf-8")


def test_the_units_are_whole_and_systemd_takes_them_where_it_is(tmp_path: Path) -> None:
    units = [tmp_path / f"auditor-refresh.{kind}" for kind in ("service", "timer")]
    for path, text in zip(units, re.findall(r"```ini\n(.*?)```", PAGE, re.DOTALL), strict=True):
        path.write_text(text)
        ConfigParser(interpolation=None).read_string(text)
    if tool := shutil.which("systemd-analyze"):
        ended = subprocess.run([tool, "verify", *map(str, units)], capture_output=True, text=True, check=False)
        assert (ended.returncode, ended.stderr) == (0, "")


def test_the_numbers_of_the_page_are_those_of_the_program() -> None:
    text = " ".join(PAGE.split())
    assert f"fewer than {CLEAN_DRIVE.fewest_frames} frames" in text
    assert f"no incident at r = {CLEAN_DRIVE.raised_r:g}" in text
    assert (CLEAN_DRIVE.most_raised, "more than half of the new recordings" in text) == (0.5, True)
    assert (INFLUENCE.fewest_first, "at least three recordings" in text) == (3, True)
    assert (INFLUENCE.most_of_a_day, "Of one vehicle and day three" in text) == (3, True)
    assert (INFLUENCE.most_drives, "of all a hundred" in text) == (100, True)
    assert (GATE.most_step, "half a standard deviation" in text) == (0.5, True)
    assert (GATE.most_creep, "more than one standard deviation" in text) == (1.0, True)
    assert (GATE.most_lost, "more than 3 %" in text) == (0.03, True)
    assert (GATE.most_lost_in_all, "more than 5 % of planted attacks" in text) == (0.05, True)
    assert (GATE.most_false_alarms, "eight times r" in text) == (8.0, True)
    assert (INFLUENCE.share, "of one vehicle or one day a third" in text) == (0.34, True)
    assert (INFLUENCE.most_of_a_place, "of one road five" in text) == (5, True)
    assert (INFLUENCE.cell_m, "cells of 100 m" in text) == (100.0, True)
    assert f"with chance {TWO_SAMPLES.chance:g}" in text
    assert (TWO_SAMPLES.fewest_drives, "Fewer than eight others" in text) == (8, True)
    assert f"as if {CONDITIONS.windows_of_all:.0f} windows more" in text
    assert (
        CONDITIONS.fewest_drives,
        f"fewer than three recordings or {CONDITIONS.fewest_windows} windows" in text,
    ) == (
        3,
        True,
    )


def test_the_numbers_of_the_page_on_drift_are_those_of_the_program() -> None:
    text = " ".join((ROOT / "docs" / "drift.md").read_text(encoding="utf-8").split())
    assert f"A day of fewer than {DRIFT.fewest_frames} frames" in text
    assert (DRIFT.extreme, "drawn to two deviations" in text) == (2.0, True)
    assert (DRIFT.days_around, "the median of the five days around it" in text) == (5, True)
    assert (DRIFT.days_beside, "medians of up to seven days beside it" in text) == (7, True)
    assert (DRIFT.rougher, "multiplied by ten" in text) == (10.0, True)
    assert (DRIFT.false_alarms, "on one evening of a hundred" in text) == (0.01, True)
