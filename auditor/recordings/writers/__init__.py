"""Writers: frames become MCAP files, .bag files and rosbag2 folders, by the packages mcap and rosbags."""
