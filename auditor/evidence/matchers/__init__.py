"""Stereo matchers: two rectified images become a disparity map."""
