"""The robot in Isaac Lab 3, without Isaac Sim: its own environment, spoken to over a pipe."""
