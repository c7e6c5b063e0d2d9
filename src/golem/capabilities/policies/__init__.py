"""Learned policies that see what the robot sees and say what it does, and the vectors in which they are spoken to."""
