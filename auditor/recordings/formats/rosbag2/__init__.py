"""ROS 2 databases (.db3), read without SQL."""
