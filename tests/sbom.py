"""Write what a wheel needs as a CycloneDX 1.6 SBOM: `python tests/sbom.py VENV OUT.cdx.json`.

VENV is an environment into which the wheel alone was installed. cyclonedx-py lists it; what is of this machine is taken
out, and what is left is validated.
"""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent


def sbom(environment: Path) -> dict[str, Any]:
    """The SBOM of an environment, the project as its root. Raises ValueError where it is not valid."""
    # Importing them takes 1.5 s of CPU: every process of the suite imports this module, and one test validates.
    from cyclonedx.schema import SchemaVersion  # noqa: PLC0415
    from cyclonedx.validation.json import JsonStrictValidator  # noqa: PLC0415

    tool = Path(sys.executable).with_name("cyclonedx-py")
    flags = ["--spec-version", "1.6", "--output-reproducible", "--no-validate", "--pyproject", ROOT / "pyproject.toml"]
    done = subprocess.run([tool, "environment", *flags, environment], check=True, capture_output=True)
    written: dict[str, Any] = json.loads(done.stdout)
    for component in written["components"]:
        named = component.get("externalReferences", [])
        component["externalReferences"] = [one for one in named if one["url"].startswith("https://")]
    wrong = JsonStrictValidator(SchemaVersion.V1_6).validate_str(json.dumps(written))
    if wrong is not None:
        raise ValueError(wrong)
    return written


if __name__ == "__main__":
    found = sbom(Path(sys.argv[1]))
    Path(sys.argv[2]).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    print(f"{len(found['components'])} components")
