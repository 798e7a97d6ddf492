"""The .db3 files of ROS 2 recordings, read without SQL."""
