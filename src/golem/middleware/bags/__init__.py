"""Bags: MCAP files with the messages of a run, as ROS 2 tools write and read them, and live views of the same."""
