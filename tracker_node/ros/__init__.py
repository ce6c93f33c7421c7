"""ROS 2 at the edge: nodes, conversions of messages, quality of service, processes.

Nothing here computes poses: each node converts, calls the core and publishes. Begin with `tracker.node`; `guarded_node`,
`executor` and `ending` are what all nodes share.
"""
