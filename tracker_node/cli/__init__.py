"""The command line: ``tracker_node <verb>``. Verbs parse arguments, call the package, and print.

Each verb is a module, here, in `groups` or in `nodes`, with ``SUMMARY``, ``EXAMPLE``, ``add_arguments`` and ``run``. Begin with
`main`.
"""
