"""Leg policies as their trainers describe them, one module per format."""
