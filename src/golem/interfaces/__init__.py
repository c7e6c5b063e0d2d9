"""What this robot says: typed streams with their payloads, the public table, converters to ROS messages."""
