"""Whose fault: modules are exchanged for truth, or for worse ones, and the same trials are run again."""
