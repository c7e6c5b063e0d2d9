"""Grasp methods: from an object to where the gripper shall close."""
