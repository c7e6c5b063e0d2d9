"""Checks what a trainer says of a leg policy before a motor moves: by its numbers, then by how the twin walks."""
