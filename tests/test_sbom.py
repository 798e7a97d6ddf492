"""The SBOM that goes with the wheel is valid, complete, and says nothing of the machine that made it."""

import json
import shutil
import sys
import venv
from importlib.metadata import distribution, version
from pathlib import Path

import pytest
from packaging.utils import canonicalize_name

from tests import sbom as making
from tests.sbom import sbom
from tests.test_advisories import PROJECT, Requirement


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """An environment of this checkout and what it needs itself, as metadata: listing all that tests need takes long."""
    venv.create(tmp_path / "venv")
    [packages] = (tmp_path / "venv" / "lib").glob("*/site-packages")
    for name in ("auditor", *(Requirement(line).name for line in PROJECT["dependencies"])):
        own = distribution(name)
        [metadata] = {file.parent for file in own.files or () if file.name == "METADATA"}
        shutil.copytree(str(own.locate_file(metadata)), packages / metadata.name)
    return tmp_path / "venv"


def test_it_is_valid_complete_and_names_no_path_of_the_machine(small: Path) -> None:
    written = sbom(small)
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
