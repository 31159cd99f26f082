"""ROS 1, by a node in a process of its own: rospy belongs to another Python than ours, and may die.

`node_at` is that process; whoever wants to hear or to say something at the same master shares it.
"""
