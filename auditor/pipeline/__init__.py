"""The chain above the rooms: recordings are measured, measurements judged, many at a time."""
