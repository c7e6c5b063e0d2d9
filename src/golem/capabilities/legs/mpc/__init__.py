"""Sampling model predictive control of the legs over MuJoCo rollouts (paper: Model-Based Lower-Body Control)."""
