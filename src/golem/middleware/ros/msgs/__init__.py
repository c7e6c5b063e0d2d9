"""Message classes by ROS package, e.g. `from golem.middleware.ros.msgs.sensor_msgs import Image`; generated."""
