"""Pictures of a frame for people: every camera at full resolution, and the cloud, with what is damaged."""

from auditor.measurement.drawing.frame import blur_around, damaged_cloud, draw_frame, draw_overlays

__all__ = ["blur_around", "damaged_cloud", "draw_frame", "draw_overlays"]
