"""KITTI's raw and odometry folders."""
