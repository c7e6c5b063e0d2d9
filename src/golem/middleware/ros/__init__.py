"""ROS 2 without ROS: message types (`codec`), and nodes with topics, services and actions over the DDS transport."""
