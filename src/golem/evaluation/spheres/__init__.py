"""Makes the spheres of a robot from its URDF or MJCF, and judges them against its meshes: `golem model spheres`."""
