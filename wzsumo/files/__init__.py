"""What is read and written: traces, ROS maps, layouts, point clouds; whole or not at all."""
