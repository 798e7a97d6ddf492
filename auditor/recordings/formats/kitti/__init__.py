"""The folders of KITTI's raw drives and of its odometry benchmark."""
