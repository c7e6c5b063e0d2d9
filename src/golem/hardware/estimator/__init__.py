"""Base estimation: where base_link is, from what the robot measures itself."""
