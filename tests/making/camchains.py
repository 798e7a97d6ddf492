"""Kalibr's camchain.yaml."""

from auditor.model.optics.geometry import invert, motion
from auditor.model.rig import Rig

CAMERA_MODELS = {"double_sphere": "ds", "omnidirectional": "omni"}


def camchain(rig: Rig) -> str:
    """As Kalibr writes it: cam0 is the leftmost camera here."""
    lines, before = [], None
    for number, camera in enumerate(reversed(rig.cameras)):
        place, kind = motion(camera.rotation.T, camera.centre_m), CAMERA_MODELS.get(camera.lens.model, "pinhole")
        D, K = camera.lens.as_published(camera.intrinsics)
        own = {"ds": 2, "omni": 1, "pinhole": 0}[kind]
        model = "radtan" if camera.lens.model in {"plumb_bob", "omnidirectional"} else camera.lens.model
        lines += [f"cam{number}:", "  cam_overlaps: []", f"  camera_model: {kind}"]
        lines += [f"  distortion_coeffs: {list(D[own:])}", f"  distortion_model: {'none' if kind == 'ds' else model}"]
        lines += [f"  intrinsics: {[*D[:own], float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2])]}"]
        lines += [f"  resolution: [{camera.width_px}, {camera.height_px}]", f"  rostopic: {camera.topic}"]
        if before is not None:
            lines += ["  T_cn_cnm1:", *(f"  - {row}" for row in (invert(place) @ before).tolist())]
        before = place
    return "\n".join(lines) + "\n"
