"""Scenes the robot can stand in."""
