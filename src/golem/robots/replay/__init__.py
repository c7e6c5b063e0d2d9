"""A recorded robot in place of a real or a simulated one."""
