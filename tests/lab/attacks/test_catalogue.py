"""A kind of attack stands beside its class: help, choices and documents take it from there."""

import pytest

from auditor.cli import run
from auditor.lab.attacks.catalogue import KINDS
from tests.attack_table import DOCUMENT, table


def test_the_document_has_the_table_of_the_catalogue() -> None:
    assert table() in DOCUMENT.read_text(encoding="utf-8"), "python -m tests.attack_table writes it"


def test_help_says_what_each_kind_does_and_what_its_size_is(capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["attack", "--help"]) == 0
    shown = " ".join(capfd.readouterr().out.split())
    assert all(f" {name} {kind.in_words}" in shown for name, kind in KINDS.items())


def test_a_mistyped_kind_names_the_nearest(capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["attack", "a.mcap", "b.mcap", "--on", "S_1", "--kind", "facla"]) == 2
    assert "did you mean 'facula'? auditor attack --help lists all" in capfd.readouterr().err
