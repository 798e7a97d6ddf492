"""Two small detectors of cars, for images and for point clouds, that were trained on synthetic streets."""
