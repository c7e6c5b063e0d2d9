"""The vendor's messages as they travel: CDR images, checksums, and their translation to and from `golem.types`."""
