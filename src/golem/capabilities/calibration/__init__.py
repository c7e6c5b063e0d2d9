"""Where cameras sit and where encoders count from, found by looking at the robot's own hands."""
