"""Pictures of a measured recording: it is opened again, and frames of it are drawn."""
