"""Collision: the robot as spheres, the world as shapes and clouds, and what is near what."""
