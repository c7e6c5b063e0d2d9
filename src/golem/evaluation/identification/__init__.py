"""What an identified robot is written as, and the command that identifies one."""
