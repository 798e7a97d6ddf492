"""The paper's published figures, for showing beside one's own: Tables I and II of Zhang et al., 2020."""

from collections.abc import Mapping

DETECTION: Mapping[int, Mapping[str, str]] = {
    1: {"0": "99.46 %", "0.01": "99.89 %", "0.02": "99.89 %", "0.03": "99.91 %", "0.05": "99.91 %"},
    2: {"0": "99.94 %", "0.01": "99.97 %", "0.02": "100 %", "0.03": "100 %", "0.05": "100 %"},
}
"""Table I: detection averaged over the seven combinations, by scenario and r."""

BASELINE: Mapping[str, tuple[str, str]] = {"0.5": ("65.32 %", "67.17 %"), "0.7": ("59.54 %", "63.39 %")}
"""Table I: the object-level baseline in Scenarios 1 and 2, by IoU."""

PRECISION = (
    "The paper: PointRCNN's AP on cars falls by 0.06 at a width of 1.5 m, YOLOv3's to 54.12 % at an area of 23.71 % "
    "(R = 187.5 px; Figs 11b and 12b)."
)

IDENTIFICATION: Mapping[str, tuple[str, ...]] = {
    "0": ("99.80 %", "96.40 %", "93.40 %", "95.60 %", "96.30 %"),
    "0.01": ("98.80 %", "97.00 %", "97.60 %", "99.20 %", "98.15 %"),
    "0.02": ("98.00 %", "96.80 %", "97.20 %", "99.20 %", "97.80 %"),
    "0.03": ("96.60 %", "96.00 %", "96.20 %", "99.80 %", "97.15 %"),
    "0.05": ("94.80 %", "94.00 %", "94.20 %", "100 %", "95.75 %"),
}
"""Table II: identification of one attacked sensor, S_0 to S_3 and average, by r."""

TABLE_RATES = tuple(IDENTIFICATION)
"""The designated false-alarm rates r of both tables."""

WALLS = "The paper: nearly 100 % from a width of 1.5 m on (Fig. 11)."
FACULAS = (
    "The paper: a small rate for areas of 5 to 15 %, over 90 % at 23.71 % (R = 187.5 px; Fig. 12). It attacks the left "
    "camera, which is the reference, and gives no strength."
)
CURVES = {
    1: "The paper: 100 % at every r in five of the seven cases; for S_1 and for S_1 with S_2 over 99.5 % below r = 5 % "
    "(Fig. 6).",
    2: "The paper: 100 % at every r in all cases (Fig. 8).",
}
DISTRIBUTIONS = {
    1: "The paper: clean E mostly below 0.20, attacked mostly above 0.25 (Fig. 5).",
    2: "The paper: clean E virtually always below 0.10, attacked above 0.125 in 99 % (Fig. 7).",
}
PANEL = "The paper: E_{0,1,3} mostly below 0.23 while none of its sensors is attacked, above while one is (Fig. 9)."
IDENTIFICATION_CURVES = (
    "The paper: falls linearly with r where a source camera or the LiDAR is attacked, stays close to 100 % where the "
    "reference camera is (Fig. 10)."
)
