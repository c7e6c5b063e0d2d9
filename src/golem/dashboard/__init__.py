"""Watching the robot work: a live view in the browser and films. Above the stack; nothing depends on it."""
