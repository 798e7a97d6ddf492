"""The recipes: what they run is what the command line takes, and what CI runs."""

import importlib.util
import json
import re
import shlex
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import click
import pytest
from ruamel.yaml import YAML

from auditor.cli import auditor
from auditor.cli.settings import read_file
from auditor.pipeline.remote.finding import Shard, shard_of
from auditor.store.store import Store
from tests.making import stand_in_ray
from tests.making.small_drives import DAY_NS, START_NS, THREE_CAMERAS, write_drive

ROOT = Path(__file__).resolve().parents[1]
REFRESH = (ROOT / "docs" / "refresh.md").read_text(encoding="utf-8")
SETTINGS = (ROOT / "docs" / "settings.md").read_text(encoding="utf-8")
CONTAINER = (ROOT / "recipes" / "Containerfile").read_text(encoding="utf-8")
DAG_FILE = ROOT / "recipes" / "airflow_refresh.py"


def parsed(line: str) -> str:
    """The verb of a command line, once its own parser took all of its words. Fails as click does."""
    words = shlex.split(line)
    words = words[words.index("auditor") + 1 :]
    context = click.Context(auditor, info_name="auditor")
    command = auditor.get_command(context, words[0])
    assert command is not None, words
    command.make_context(words[0], words[1:], parent=context)
    return words[0]


def operators(monkeypatch: pytest.MonkeyPatch) -> dict[str, dict[str, object]]:
    """The tasks of the DAG by id: by Airflow itself where it is installed, else by stand-ins of its two classes."""
    if importlib.util.find_spec("airflow") is not None:
        from airflow.dag_processing.dagbag import DagBag  # noqa: PLC0415 - only where it is installed

        monkeypatch.setenv("AIRFLOW__CORE__LOAD_EXAMPLES", "False")
        bag = DagBag(str(DAG_FILE))
        assert bag.import_errors == {}
        return {task.task_id: vars(task) for task in bag.dags["auditor_refresh"].tasks}
    found: dict[str, dict[str, object]] = {}

    class Dag:
        def __init__(self, name, **named):
            assert (name, named["catchup"], named["max_active_runs"]) == ("auditor_refresh", False, 1)

        def __enter__(self):
            return self

        def __exit__(self, *_):
            return None

    class Operator:
        def __init__(self, *, task_id, **named):
            found[task_id] = named

        def __rshift__(self, other):
            return other

    for name in ("airflow", "airflow.providers", "airflow.providers.standard", "airflow.providers.standard.operators"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    for name, known in (
        ("airflow.sdk", {"DAG": Dag}),
        ("airflow.providers.standard.operators.bash", {"BashOperator": Operator}),
    ):
        module = ModuleType(name)
        vars(module).update(known)
        monkeypatch.setitem(sys.modules, name, module)
    exec(compile(DAG_FILE.read_text(encoding="utf-8"), DAG_FILE, "exec"), {})
    return found


def test_the_tasks_of_the_dag_are_command_lines(monkeypatch):
    tasks = operators(monkeypatch)
    assert [parsed(str(task["bash_command"])) for task in tasks.values()] == ["refresh", "drift"]
    assert [task["skip_on_exit_code"] for task in tasks.values()] in ([1, 3], [[1], [3]])
    assert tasks["drift"]["trigger_rule"] == "all_done", "what drifts is looked at also where a refresh is refused"


def test_what_cron_and_systemd_run_are_command_lines():
    cron = re.findall(r"^\d+ \d+ \* \* \*  (auditor .*)$", REFRESH, re.MULTILINE)
    systemd = re.findall(r"^ExecStart=(.*)$", REFRESH, re.MULTILINE)
    assert [parsed(line) for line in (*cron, *systemd)] == ["refresh", "refresh"]


def test_a_wrong_word_in_a_recipe_would_be_found():
    with pytest.raises(click.UsageError):
        parsed("auditor refresh --stroe fleet")


def test_the_container_is_built_by_the_commands_of_ci_and_runs_a_command_line():
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    for command in ("-m build --wheel --outdir", "python3 -m venv", "install -q", "auditor query &&"):
        assert command in CONTAINER
        assert command in script
    [run] = re.findall(r"^# podman run .* (auditor refresh .*)$", CONTAINER, re.MULTILINE)
    assert parsed(run) == "refresh"
    assert json.loads(re.findall(r"^ENTRYPOINT (.*)$", CONTAINER, re.MULTILINE)[0]) == ["auditor"]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert "auditor" in project["project"]["scripts"]
    assert CONTAINER.index("USER auditor") < CONTAINER.index("ENTRYPOINT"), "it does not run as root"


def test_the_container_copies_what_the_wheel_is_built_of():
    copied = {word for line in re.findall(r"^COPY (?!--)(.*)$", CONTAINER, re.MULTILINE) for word in line.split()[:-1]}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    wheel = project["tool"]["hatch"]["build"]["targets"]["wheel"]
    needed = {
        "pyproject.toml",
        project["project"]["readme"],
        *project["project"]["license-files"],
        *wheel["packages"],
        *wheel["force-include"],
    }
    assert needed <= copied
    assert all((ROOT / one).exists() for one in copied)
    known = {"FROM", "WORKDIR", "COPY", "RUN", "USER", "ENV", "ENTRYPOINT", "CMD"}
    lines = [line for line in CONTAINER.splitlines() if line and not line.startswith("#")]
    assert {line.split()[0] for line in lines} == known


def test_the_settings_of_the_page_are_settings(tmp_path):
    [example] = re.findall(r"```toml\n(.*?)```", SETTINGS, re.DOTALL)
    (tmp_path / "auditor.toml").write_text(example)
    found = read_file(tmp_path / "auditor.toml", auditor, click.Context(auditor))
    assert found["scan"]["store"] == "/srv/fleet"
    assert found["scan"]["r"] == "0.001"
    assert found["calibration"]["list"]["form"] == "json"
    assert found["drift"]["every"] is True


def test_the_variables_of_the_page_are_those_of_options():
    context = click.Context(auditor)
    known = {"AUDITOR_CONFIG", "AUDITOR_LOG_FORMAT"}
    for verb in auditor.list_commands(context):
        commands = [auditor.get_command(context, verb)]
        for command in commands:
            commands += [*getattr(command, "commands", {}).values()]
            known |= {name for option in command.params for name in option.envvar or ()}
    named = set(re.findall(r"`(AUDITOR_\w+)`", SETTINGS))
    assert len(named) > 10
    assert named <= known


KUBERNETES = (ROOT / "recipes" / "kubernetes_scan.yaml").read_text(encoding="utf-8")
SHARDS = ROOT / "recipes" / "airflow_shards.py"
RAY = ROOT / "recipes" / "ray_scan.py"


def test_the_jobs_of_kubernetes_run_each_shard_once_and_then_the_scan_that_judges():
    shards, verdicts = YAML(typ="safe").load_all(KUBERNETES)
    [line] = shards["spec"]["template"]["spec"]["containers"][0]["args"]
    count = shards["spec"]["completions"]
    assert shards["spec"]["completionMode"] == "Indexed"
    assert f"--shard $JOB_COMPLETION_INDEX/{count}" in line
    assert parsed(line.replace("$JOB_COMPLETION_INDEX", str(count - 1))) == "scan"
    [judging] = verdicts["spec"]["template"]["spec"]["containers"][0]["args"]
    assert line.split(" --shard")[0] == judging
    assert parsed(judging) == "scan"


def test_the_mapped_task_of_airflow_has_each_shard_once(monkeypatch):
    mapped, tasks = [], {}

    class Dag:
        def __init__(self, name, **_):
            assert name == "auditor_shards"

        def __enter__(self):
            return self

        def __exit__(self, *_):
            return None

    class Operator:
        def __init__(self, **named):
            tasks[named["task_id"]] = named

        @classmethod
        def partial(cls, **named):
            return cls(**named)

        def expand(self, *, bash_command):
            mapped.extend(bash_command)
            return self

        def __rshift__(self, other):
            return other

    stand_in(monkeypatch, "airflow.sdk", DAG=Dag)
    stand_in(monkeypatch, "airflow.providers.standard.operators.bash", BashOperator=Operator)
    exec(compile(SHARDS.read_text(encoding="utf-8"), SHARDS, "exec"), {})
    assert [parsed(line) for line in mapped] == ["scan"] * len(mapped)
    assert [shard_of(line.split()[-1]) for line in mapped] == [Shard(n, len(mapped)) for n in range(len(mapped))]
    assert parsed(tasks["verdicts"]["bash_command"]) == "scan"


def test_the_scan_on_ray_measures_and_judges_everything(tmp_path, monkeypatch, capsys):
    for number in range(2):
        start_ns = START_NS + number * DAY_NS
        write_drive(tmp_path / f"drive{'ab'[number]}.mcap", 3, positions_m=THREE_CAMERAS, start_ns=start_ns)

    stand_in_ray.stand_in(monkeypatch)
    monkeypatch.setattr(sys, "argv", ["ray_scan.py", str(tmp_path), str(tmp_path / "store")])
    exec(compile(RAY.read_text(encoding="utf-8"), RAY, "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().out.splitlines()[-1] == "0 recordings with findings"
    store = Store.open(tmp_path / "store")
    assert len(store.ids("measurements")) == len(store.current_judgements()) == 2


def stand_in(monkeypatch: pytest.MonkeyPatch, name: str, **known: object) -> None:
    """Let a module, and the packages that it is in, be there with these names, as if it were installed."""
    words = name.split(".")
    for count in range(1, len(words)):
        monkeypatch.setitem(sys.modules, ".".join(words[:count]), ModuleType(words[count - 1]))
    module = ModuleType(name)
    vars(module).update(known)
    monkeypatch.setitem(sys.modules, name, module)
