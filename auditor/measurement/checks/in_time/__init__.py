"""The checks of a lone camera by its own past: pictures of several moments, and how the camera moved between them."""
