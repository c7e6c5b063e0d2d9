"""GOLEM: a modular autonomy stack for the Unitree H1-2 humanoid."""

__version__ = "0.1.0"
