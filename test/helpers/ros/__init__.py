"""ROS graphs of real processes, and what is sent through them."""
