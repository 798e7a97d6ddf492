from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat, PublicFormat

from auditor.casefile.write import CaseSettings, write_case
from auditor.store.log.signatures import signing_key
from tests.making.case_stores import AttackedStore


@pytest.fixture(scope="session")
def private_key(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a private key; the public one stands beside it as public.pem."""
    path = tmp_path_factory.mktemp("keys") / "private.pem"
    key = Ed25519PrivateKey.generate()
    path.write_bytes(key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    public = key.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo)
    path.with_name("public.pem").write_bytes(public)
    return path


@pytest.fixture(scope="session")
def lidar_case(attacked: AttackedStore, private_key: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The case of the attack on the LiDAR, signed."""
    folder = tmp_path_factory.mktemp("cases") / "lidar"
    settings = CaseSettings(seconds=0.2, key=signing_key(private_key))
    case = write_case(attacked.store, attacked.incident(0)[:10], folder, settings)
    assert not case.remarks
    return folder


@pytest.fixture(scope="session")
def redacted_case(attacked: AttackedStore, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The case of the attack on the camera, redacted."""
    folder = tmp_path_factory.mktemp("cases") / "camera"
    write_case(attacked.store, attacked.incident(2), folder, CaseSettings(seconds=0.3, redact=True))
    return folder
