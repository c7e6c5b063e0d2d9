"""Data sets of demonstrations in LeRobot's format v3.0, and the rungs of the ladder as gymnasium environments."""
