"""ROS 1: topics, heard by a process of its own."""
