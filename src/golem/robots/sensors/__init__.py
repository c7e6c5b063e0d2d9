"""What the robot's sensors get wrong: cameras, depth, IMU, encoders, and the profiles that say by how much."""
