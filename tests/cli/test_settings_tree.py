"""Every setting of judging and measuring is the same setting on the command line, as a variable, in a file, and in
Python; the document lists them all.
"""

from dataclasses import fields
from decimal import Decimal
from pathlib import Path

import pytest

import auditor
from auditor.cli import run
from auditor.errors import SettingError
from auditor.measurement.disparity.matchers import MatcherOptions
from auditor.model.pictures import CellRetention, Pictures
from auditor.model.settings import (
    Criteria,
    Engine,
    MeasureSettings,
    about,
    default,
    settings_of,
)
from auditor.model.verdict import Method, Statistic
from auditor.pipeline import library, many
from auditor.pipeline.keywords import JudgingKeywords, MeasuringKeywords
from auditor.store.store import Store
from tests.settings_table import DOCUMENT, table

EXAMPLES = {
    "r": ("2%", Decimal("0.02")),
    "method": ("paper", Method.PAPER),
    "statistic": ("plain", Statistic.PLAIN),
    "incidents_per_hour": ("0.5", 0.5),
    "transfer": (True, True),
    "strict": (True, True),
    "recount": (True, True),
    "calibration": ("4be19a40", "4be19a40"),
    "min_coverage": ("0.5", 0.5),
    "min_view": ("0.25", 0.25),
    "no_sensors": (["/radar"], ("/radar",)),
    "matcher": ("sgbm-full", "sgbm-full"),
    "weights": ("net.safetensors", Path("net.safetensors")),
    "align_corners": (True, True),
    "max_disparity": ("64", 64),
    "device": ("cuda:1", "cuda:1"),
    "precision": ("bf16", "bf16"),
    "compiled": (True, True),
    "rig": ("rig.toml", Path("rig.toml")),
    "vehicle": ("car7", "car7"),
    "weather": ("snow", "snow"),
    "drive": ("night", "night"),
    "path_pattern": ("{vehicle}/*.mcap", "{vehicle}/*.mcap"),
    "time_limit": ("30", 30.0),
    "memory_limit": ("512", 512.0),
    "jobs": ("3", 3),
    "pictures": ("none", Pictures.NONE),
    "cells": ("all", CellRetention.ALL),
    "measure_again": (True, True),
    "verify_content": (True, True),
    "shard": ("1/4", "1/4"),
    "engine": ("ray", Engine.RAY),
    "address": ("auto", "auto"),
    "spool": ("copies", Path("copies")),
    "spool_limit": ("1000", 1000.0),
}
"""Of each setting a value that is not its default: as it is written on a command line, and as it is meant."""

CASES = [("judge", Criteria, name) for name in settings_of(Criteria)]
CASES += [("scan", Criteria, name) for name in settings_of(Criteria) if name != "recount"]
CASES += [("scan", MeasureSettings, name) for name in settings_of(MeasureSettings)]


@pytest.fixture
def taken(tmp_path, monkeypatch):
    """The settings with which a verb or function begins its work, by their class; the work itself is not done."""
    monkeypatch.chdir(tmp_path)
    Store.open(tmp_path / "audit", create=True)
    settings = {}

    def begun(*given):
        settings.update((type(one), one) for one in given)
        raise SettingError("this is where the work begins")

    monkeypatch.setattr(library, "judge_store", begun)
    monkeypatch.setattr(library, "judge_settings", lambda _, judging: settings.update({Criteria: judging}))
    for module in (library, many):
        monkeypatch.setattr(module, "find_batch", begun)
    return settings


def flag_of(name):
    return about(settings_of(Criteria, MeasureSettings)[name]).flag or name.replace("_", "-")


def by_command_line(verb, name, text, monkeypatch):
    flag = f"-{name}" if len(name) == 1 else f"--{flag_of(name)}"
    values = [] if text is True else text if isinstance(text, list) else [text]
    run([verb, *(["logs"] if verb == "scan" else []), flag, *values])


def by_variable(verb, name, text, monkeypatch):
    value = "1" if text is True else " ".join(text) if isinstance(text, list) else text
    monkeypatch.setenv(f"AUDITOR_{verb}_{flag_of(name)}".upper().replace("-", "_"), value)
    run([verb, *(["logs"] if verb == "scan" else [])])


def by_file(verb, name, text, monkeypatch):
    value = "true" if text is True else repr(text)
    Path("settings.toml").write_text(f"[{verb}]\n{flag_of(name)} = {value}\n")
    run(["--config", "settings.toml", verb, *(["logs"] if verb == "scan" else [])])


def by_keyword(verb, name, text, monkeypatch):
    with pytest.raises(SettingError, match="where the work begins"):
        auditor.judge("audit", **{name: text}) if verb == "judge" else auditor.scan("logs", **{name: text})


def number(name, text):
    """A text as Python has it: numbers of keywords are numbers."""
    return EXAMPLES[name][1] if isinstance(EXAMPLES[name][1], int | float) else text


def test_the_examples_are_of_all_settings():
    assert EXAMPLES.keys() == settings_of(Criteria, MeasureSettings).keys()


@pytest.mark.parametrize(("verb", "kind", "name"), CASES, ids=lambda one: getattr(one, "__name__", one))
def test_a_setting_has_the_same_effect_whichever_way_it_is_given(taken, monkeypatch, verb, kind, name):
    text, value = EXAMPLES[name]
    assert value != default(settings_of(kind)[name])
    for way in (by_command_line, by_variable, by_file, by_keyword):
        taken.clear()
        with monkeypatch.context() as patched:
            way(verb, name, number(name, text) if way is by_keyword else text, patched)
        assert taken[kind] == kind(**{name: value}), way.__name__


@pytest.mark.parametrize("kind", [Criteria, MeasureSettings])
def test_what_is_not_given_is_the_default_on_the_command_line_and_in_python(taken, kind):
    run(["scan", "logs"])
    on_the_command_line = taken.pop(kind)
    with pytest.raises(SettingError, match="where the work begins"):
        auditor.scan("logs", **dict.fromkeys(EXAMPLES))
    assert on_the_command_line == taken[kind] == kind()


def test_the_settings_of_a_network_may_come_as_one(taken):
    network = MatcherOptions(weights=Path("net.safetensors"), device="cuda", precision="fp16", compiled=True)
    with pytest.raises(SettingError, match="where the work begins"):
        auditor.scan("logs", matcher="psmnet", network=network, device="cuda:1")
    given = {one.name: getattr(network, one.name) for one in fields(network) if one.name != "threads"}
    assert taken[MeasureSettings] == MeasureSettings(**given | {"matcher": "psmnet", "device": "cuda:1"})


def test_the_options_of_a_network_have_the_defaults_of_the_settings():
    for one in fields(MatcherOptions):
        assert one.name == "threads" or one.default == settings_of(MeasureSettings)[one.name].default, one.name


@pytest.mark.parametrize(
    ("wrong", "what"),
    [
        ({"min_coverge": 0.5}, "no setting 'min_coverge'; did you mean 'min_coverage'"),
        ({"time_limt": 3}, "no setting 'time_limt'; did you mean 'time_limit'"),
        ({"zzz": 3}, "no setting 'zzz'; use some of: r, method"),
        ({"min_coverage": 1.5}, "min_coverage cannot be 1.5"),
        ({"memory_limit": 0}, "memory_limit cannot be 0"),
        ({"time_limit": float("nan")}, "time_limit cannot be nan"),
        ({"jobs": 0}, "jobs cannot be 0"),
        ({"pictures": "some"}, "no pictures 'some'; use one of: none, incidents, all"),
        ({"precision": "fp8"}, "no precision 'fp8'"),
        ({"method": "paper", "recount": True}, "has no statistics that come from cells"),
    ],
)
def test_a_keyword_that_is_no_setting_or_out_of_range_is_refused_before_any_work(tmp_path, wrong, what):
    with pytest.raises(SettingError, match=what):
        auditor.scan("logs", store=tmp_path / "audit", **wrong)
    assert not (tmp_path / "audit").exists()


@pytest.mark.parametrize(
    ("kind", "keywords"), [(Criteria, JudgingKeywords), (MeasureSettings, MeasuringKeywords)], ids=["judge", "measure"]
)
def test_type_checkers_know_every_setting_as_a_keyword(kind, keywords):
    assert list(keywords.__annotations__) == list(settings_of(kind))


def test_the_help_of_a_function_explains_every_setting():
    for name, setting in settings_of(Criteria, MeasureSettings).items():
        assert f"\n{name}\n" in auditor.scan.__doc__
        assert about(setting).help.split()[0] in auditor.scan.__doc__.split(f"\n{name}\n")[1]


def test_the_document_lists_the_settings_as_they_are():
    assert table() in DOCUMENT.read_text(encoding="utf-8")
