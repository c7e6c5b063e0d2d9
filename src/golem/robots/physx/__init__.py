"""The robot in PhysX 5 (extra `physx`)."""
