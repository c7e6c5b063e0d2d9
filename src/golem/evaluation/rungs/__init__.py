"""The rungs of the capability ladder, one file each."""
