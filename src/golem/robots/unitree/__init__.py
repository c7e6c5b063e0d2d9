"""What the vendor's own computer on the robot does, for twins that have none."""
