"""Where the base is by LiDAR, IMU and legs: one contract, one file per method."""
