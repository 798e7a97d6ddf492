"""Makes a folder of one scene of nuScenes, which auditor reads as one recording; pictures and clouds are linked.

python recipes/nuscenes_scene.py /data/nuscenes scene-0061 /data/scene-0061
"""

import json
import sys
from pathlib import Path


def main(root: Path, scene_name: str, target: Path) -> None:
    """Write the tables of a scene, and links to its files."""
    [folder] = (file.parent for file in root.glob("v1.0-*/sample_data.json"))
    tables = {
        name: json.loads((folder / f"{name}.json").read_text("utf-8"))
        for name in ("scene", "sample", "sample_data", "calibrated_sensor", "sensor")
    }
    [scene] = (row for row in tables["scene"] if row["name"] == scene_name)
    samples = {row["token"] for row in tables["sample"] if row["scene_token"] == scene["token"]}
    data = [row for row in tables["sample_data"] if row["sample_token"] in samples]
    used = {row["calibrated_sensor_token"] for row in data}
    calibrated = [row for row in tables["calibrated_sensor"] if row["token"] in used]
    made = {"scene": [scene], "sample_data": data, "calibrated_sensor": calibrated, "sensor": tables["sensor"]}
    (target / folder.name).mkdir(parents=True)
    for name, rows in made.items():
        (target / folder.name / f"{name}.json").write_text(json.dumps(rows), "utf-8")
    linked = 0
    for row in data:
        source, file = root / row["filename"], target / row["filename"]
        if source.is_file():
            file.parent.mkdir(parents=True, exist_ok=True)
            file.hardlink_to(source)
            linked += 1
    print(f"{scene_name}: {linked} of {len(data)} files in {target}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3]))
