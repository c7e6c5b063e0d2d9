"""Maps of what LiDARs see: voxels, the floor, and files of both."""
