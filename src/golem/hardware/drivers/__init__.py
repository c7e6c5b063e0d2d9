"""Drivers: what speaks to a device by its own wires."""
