"""Settings: a file and the environment in the place of options, what goes first, and what is refused; JSON logs."""

import json

import pytest

from auditor.cli import run
from auditor.store.log.chains import entries
from auditor.store.store import Store
from tests.making.fleets import add_drive


@pytest.fixture
def audit(tmp_path, monkeypatch, capfd):
    """Runs a command line in an empty folder; answers its exit code, output and errors."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    for name in ("fleet", "other", "third"):
        Store.open(tmp_path / name, create=True)

    def audited(*words):
        capfd.readouterr()
        code = run([str(word) for word in words])
        out, err = capfd.readouterr()
        assert "defect" not in err, err
        return code, out, err

    return audited


@pytest.fixture
def written(tmp_path):
    def write(text, name="settings.toml"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    return write


def looked_at(err):
    """The store that a drift looked at, by what it said of its settings."""
    return err.partition("--store=")[2].partition(" (")[0] if "--store=" in err else "audit"


def test_the_command_line_goes_before_the_environment_before_the_file_before_the_default(audit, written, monkeypatch):
    Store.open(written("").parent / "audit", create=True)
    assert "settings" not in audit("drift")[2]
    file = written('[defaults]\nstore = "fleet"')
    assert looked_at(audit("--config", file, "drift")[2]) == "fleet"
    written('[defaults]\nstore = "fleet"\n[drift]\nstore = "third"')
    assert looked_at(audit("--config", file, "drift")[2]) == "third", "a verb's own table goes before that of all"
    monkeypatch.setenv("AUDITOR_STORE", "other")
    assert looked_at(audit("--config", file, "drift")[2]) == "other"
    monkeypatch.setenv("AUDITOR_DRIFT_STORE", "fleet")
    assert looked_at(audit("--config", file, "drift")[2]) == "fleet", "a verb's own variable goes first"
    assert "--store=" not in audit("--config", file, "drift", "--store", "third")[2]


def test_a_file_is_the_users_own_or_named_by_a_variable_or_an_option(audit, written, monkeypatch):
    written('[defaults]\nstore = "fleet"', "config/auditor/auditor.toml")
    assert looked_at(audit("drift")[2]) == "fleet"
    monkeypatch.setenv("AUDITOR_CONFIG", str(written('[defaults]\nstore = "other"')))
    assert looked_at(audit("drift")[2]) == "other"
    assert looked_at(audit("--config", written('[drift]\nstore = "third"', "named.toml"), "drift")[2]) == "third"


def test_verbs_below_a_verb_and_flags_have_settings(audit, written, monkeypatch):
    file = written('[calibration.list]\nstore = "fleet"\nformat = "json"\n[drift]\nall = true\nstore = "fleet"')
    code, out, _ = audit("--config", file, "calibration", "list")
    assert (code, json.loads(out)) == (0, [])
    assert "--all=True" in audit("--config", file, "drift")[2]
    monkeypatch.setenv("AUDITOR_CALIBRATION_LIST_FORMAT", "csv")
    assert audit("calibration", "list", "--store", "fleet")[1].startswith('"calibration_id"')


def test_what_is_set_is_said_and_stands_in_the_log_of_the_store(audit, tmp_path, written):
    add_drive(Store.open(tmp_path / "fleet"), "one", seed=1)
    _, _, err = audit("--config", written('[defaults]\nstore = "fleet"\nr = 0.5'), "judge", "fleet")
    assert "-r=0.5 (" in err
    commands = [one.what["command"] for one in entries(tmp_path / "fleet") if "command" in one.what]
    assert any(command[:2] == ["auditor", "--config"] and "-r=0.5" in command for command in commands)


def test_the_store_is_a_setting_also_where_it_is_an_argument(audit, monkeypatch, tmp_path):
    add_drive(Store.open(tmp_path / "fleet"), "one.mcap", seed=1)
    monkeypatch.setenv("AUDITOR_STORE", "fleet")
    assert "one.mcap" in audit("store", "list")[1]
    assert audit("verify")[0] == 0
    assert "one.mcap" not in audit("store", "list", "other")[1]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("[scan]\nrr = 0.1", "scan has no option 'rr'"),
        ("[defaults]\nstroe = 'x'", "no verb has an option 'stroe'"),
        ("[scna]\nr = 0.1", "there is no verb 'scna'"),
        ("r = 0.1", "there is no verb 'r'"),
        ("scan = 3", "scan is no table"),
        ("defaults = 3", "defaults is no table"),
        ("[scan]\njobs = 'four'", "jobs: 'four' is not a valid integer"),
        ("[scan]\njobs = 0", "jobs: 0 is not in the range"),
        ("[scan]\njobs = true", "jobs is True, not a text or a number"),
        ("[scan]\njobs = [1]", "jobs is [1], not a text or a number"),
        ("[scan]\nmeasure-again = 'yes'", "measure-again is 'yes', not true or false"),
        ("[scan]\nr = 7", "r: "),
        ("[refresh]\nclean = true", "refresh has no option 'clean'"),
        ("[store.remove]\nyes = true", "store.remove has no option 'yes'"),
        ("[query]\nfile = '/etc/passwd'", "query has no option 'file'"),
        ("[scan\n", "it is no TOML"),
        ("[scan]\nr = '\x1b[31m'", "it is no TOML"),
        ("#" * 70_000, "longer than 65536 bytes"),
    ],
)
def test_wrong_keys_and_values_are_one_line_that_says_where(audit, written, text, what):
    code, out, err = audit("--config", written(text), "drift", "--store", "fleet")
    assert (code, out, len(err.splitlines())) == (2, "", 1), err
    assert "settings.toml" in err
    assert what in err
    assert "\x1b" not in err


def test_a_file_that_is_missing_or_none_is_one_line(audit, tmp_path):
    for path in (tmp_path / "none.toml", tmp_path):
        code, _, err = audit("--config", path, "drift")
        assert (code, len(err.splitlines())) == (2, 1)


def test_wrong_values_in_the_environment_are_refused_by_name(audit, monkeypatch):
    monkeypatch.setenv("AUDITOR_DAYS", "many")
    code, _, err = audit("drift", "--store", "fleet")
    assert (code, "AUDITOR_DAYS" in err or "--days" in err) == (2, True)


def test_a_file_beside_the_logs_of_strangers_is_not_read(audit, written, tmp_path):
    """Else it would choose another store, laxer thresholds, or a network whose file lies beside it."""
    written('[defaults]\nstore = "other"\nr = 1\nmatcher = "onnx:evil.onnx"\nnonsense = 1', "auditor.toml")
    add_drive(Store.open(tmp_path / "fleet"), "one", seed=1)
    code, _, err = audit("drift", "--store", "fleet")
    assert code == 3
    assert "auditor.toml in this folder is not read" in err
    assert "settings:" not in err


def test_what_speaks_of_one_run_is_no_variable(audit, monkeypatch, tmp_path):
    monkeypatch.setenv("AUDITOR_CLEAN", "1")
    monkeypatch.setenv("AUDITOR_REFRESH_CLEAN", "1")
    add_drive(Store.open(tmp_path / "fleet"), "one", seed=1)
    code, _, err = audit("refresh", "--store", "fleet", "--dry-run")
    assert (code, "--clean says" in err) == (0, False), "without recordings --clean would be refused"


def test_json_logs_are_one_object_a_line_for_remarks_progress_and_errors(audit, monkeypatch, tmp_path):
    def lines(err):
        return [json.loads(line) for line in err.splitlines()]

    code, out, err = audit("--log-format", "json", "drift", "--store", "fleet", "--format", "json")
    [remark] = lines(err)
    assert (code, json.loads(out)) == (3, [])
    assert (remark["level"], remark["verb"]) == ("remark", "drift")
    monkeypatch.setenv("AUDITOR_LOG_FORMAT", "json")
    code, _, err = audit("drift", "--store", "nowhere\x1b[31m")
    [error] = lines(err)
    assert (code, error["level"], error["verb"]) == (2, "error", None)
    assert "there is no store" in error["message"]
    assert "\x1b" not in error["message"]
    [error] = lines(audit("drift", "--days", "x")[2])
    assert (error["level"], "--days" in error["message"]) == ("error", True)
    (tmp_path / "no.mcap").write_bytes(b"no recording")
    found = lines(audit("scan", "no.mcap", "--store", "fleet")[2])
    assert {"progress", "remark"} <= {one["level"] for one in found}
    assert [one["of"] for one in found if one["level"] == "progress"] == [1]
    monkeypatch.setenv("AUDITOR_LOG_FORMAT", "text")
    assert not audit("drift", "--store", "fleet")[2].startswith("{")
