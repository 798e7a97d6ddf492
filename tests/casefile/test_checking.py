"""A stranger checks a case without keys and without the store; whoever has the public key checks who made it."""

import base64
import json
import re
import shutil
import subprocess
import zipfile
from pathlib import Path

import fastjsonschema
import pytest

from auditor.casefile.checking import check_case
from auditor.casefile.folder import files_of, sha256_of
from auditor.casefile.write import write_zip
from auditor.cli import run
from auditor.errors import SettingError
from auditor.store.log.signatures import public_key
from tests.making.case_stores import AttackedStore

STATEMENT = {
    "type": "object",
    "required": ["_type", "subject", "predicateType", "predicate"],
    "properties": {
        "_type": {"const": "https://in-toto.io/Statement/v1"},
        "subject": {
            "type": "array",
            "minItems": 1,
            "items": {
                "type": "object",
                "required": ["name", "digest"],
                "properties": {
                    "name": {"type": "string", "minLength": 1},
                    "digest": {
                        "type": "object",
                        "required": ["sha256"],
                        "additionalProperties": {"type": "string", "pattern": "^[0-9a-f]{64}$"},
                    },
                    "annotations": {"type": "object"},
                },
                "additionalProperties": False,
            },
        },
        "predicateType": {"type": "string", "format": "uri", "pattern": "^[a-z][a-z0-9+.-]*:"},
        "predicate": {"type": "object"},
    },
    "additionalProperties": False,
}
"""The layout of an in-toto statement, version 1, and of its resource descriptors."""


@pytest.fixture
def case(lidar_case: Path, tmp_path: Path) -> Path:
    """A copy of a signed case that a test may change."""
    return Path(shutil.copytree(lidar_case, tmp_path / "case"))


def test_the_manifest_is_an_in_toto_statement_over_every_file(lidar_case: Path) -> None:
    statement = json.loads((lidar_case / "manifest.json").read_text())
    fastjsonschema.validate(STATEMENT, statement)
    subjects = {one["name"]: one["digest"]["sha256"] for one in statement["subject"]}
    others = set(files_of(lidar_case)) - {"manifest.json", "manifest.dsse.json", "SHA256SUMS"}
    assert subjects == {name: sha256_of(lidar_case / name) for name in others}
    predicate = statement["predicate"]
    assert {"tool", "store_heads", "calibration_id", "recording_sha256", "incident_id"} <= predicate.keys()
    assert all(re.fullmatch(r"[0-9a-f]{64}", head) for head in predicate["store_heads"].values())


def test_a_whole_case_has_no_problems_as_folder_and_as_zip(case: Path, tmp_path: Path, private_key: Path) -> None:
    write_zip(case, tmp_path / "case.zip")
    key = public_key(private_key.with_name("public.pem"))
    for path in (case, tmp_path / "case.zip"):
        assert check_case(path).problems == ()
        assert check_case(path, key).problems == ()
        assert run(["verify", str(path)]) == 0
    assert (tmp_path / "case.zip").stat().st_mode & 0o777 == 0o600
    assert subprocess.run(["sha256sum", "--quiet", "-c", "SHA256SUMS"], cwd=case, check=False).returncode == 0


def test_a_flipped_byte_of_any_file_is_found_without_a_key(case: Path) -> None:
    for name in files_of(case):
        path = case / name
        kept = path.read_bytes()
        place = len(kept) // 2
        path.write_bytes(kept[:place] + bytes([kept[place] ^ 1]) + kept[place + 1 :])
        try:
            problems = check_case(case).problems
        except SettingError as error:
            problems = (str(error),)
        assert any(name in problem for problem in problems), name
        path.write_bytes(kept)
    assert not check_case(case).problems


@pytest.mark.parametrize("name", ["clip.mcap", "manifest.json", "manifest.dsse.json", "SHA256SUMS"])
def test_sha256sum_finds_it_too(case: Path, name: str, capfd: pytest.CaptureFixture[str]) -> None:
    path = case / name
    kept = path.read_bytes()
    path.write_bytes(bytes([kept[0] ^ 1]) + kept[1:])
    done = subprocess.run(["sha256sum", "--quiet", "--strict", "-c", "SHA256SUMS"], cwd=case, check=False)
    assert done.returncode == 1
    if name == "clip.mcap":
        assert run(["verify", str(case)]) == 1
        assert "clip.mcap: it is not as it was written" in capfd.readouterr().out


def test_missing_and_added_files_are_named(case: Path) -> None:
    (case / "ticket.json").unlink()
    (case / "pictures" / "more.jpg").write_bytes(b"")
    (case / "link").symlink_to("clip.mcap")
    assert check_case(case).problems == (
        "link: it was added: the manifest does not name it",
        "pictures/more.jpg: it was added: the manifest does not name it",
        "ticket.json: it is missing",
    )


def test_another_key_and_a_case_that_nobody_signed_are_told(
    case: Path, redacted_case: Path, attacked: AttackedStore, private_key: Path, tmp_path: Path
) -> None:
    key = public_key(private_key.with_name("public.pem"))
    assert check_case(redacted_case, key).problems == ("manifest.dsse.json: nobody signed this case",)
    envelope = json.loads((case / "manifest.dsse.json").read_text())
    assert base64.b64decode(envelope["payload"]) == (case / "manifest.json").read_bytes()
    signature = bytearray(base64.b64decode(envelope["signatures"][0]["sig"]))
    signature[0] ^= 1
    envelope["signatures"][0]["sig"] = base64.b64encode(signature).decode()
    (case / "manifest.dsse.json").write_text(json.dumps(envelope))
    assert "manifest.dsse.json: the holder of this key did not sign it" in check_case(case, key).problems


def test_what_is_no_case_is_one_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "text.zip").write_text("no zip")
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as archive:
        archive.writestr("a/b.txt", "b")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "manifest.json").write_text("[1]")
    for name in ("text.zip", "other.zip", "folder"):
        assert run(["verify", str(tmp_path / name)]) == 2
        [line] = capfd.readouterr().err.splitlines()
        assert "it is no case" in line or "is no manifest of a case" in line
