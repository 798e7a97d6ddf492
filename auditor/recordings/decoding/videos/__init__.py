"""Videos in messages: what their headers say, and their pictures, decoded by FFmpeg through the extra `video`."""
