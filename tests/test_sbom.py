"""The SBOM that goes with the wheel is valid, complete, and says nothing of the machine that made it."""

import json
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from packaging.utils import canonicalize_name

from tests import sbom as making
from tests.sbom import sbom
from tests.test_advisories import PROJECT, Requirement


def test_it_is_valid_complete_and_names_no_path_of_the_machine() -> None:
    written = sbom(Path(sys.prefix))
    text = json.dumps(written)
    assert (written["bomFormat"], written["specVersion"]) == ("CycloneDX", "1.6")
    listed = {canonicalize_name(one["name"]): one for one in written["components"]}
    for line in PROJECT["dependencies"]:
        name = Requirement(line).name
        component = listed[canonicalize_name(name)]
        assert component["version"] == version(name)
        assert component["purl"].startswith("pkg:pypi/")
    assert written["metadata"]["component"]["name"] == "auditor"
    assert "file:" not in text
    assert str(Path(sys.prefix)) not in text


def test_what_is_not_valid_is_not_written(monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = json.dumps({"bomFormat": "CycloneDX", "specVersion": "1.6", "version": 1, "components": [{"name": "x"}]})
    monkeypatch.setattr(making.subprocess, "run", lambda *_, **__: making.subprocess.CompletedProcess((), 0, wrong))
    with pytest.raises(ValueError, match="type"):
        sbom(Path(sys.prefix))
