"""ROS 2 nodes: thin translations of parameters and messages."""
