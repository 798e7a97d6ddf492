"""CameraInfo, tf and files become rigs."""
