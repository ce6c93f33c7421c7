"""The command line: ``tracker_node <verb>``. Verbs parse arguments, call the package, and print.

Each verb is a module, or a package of sub-verbs, with ``SUMMARY``, ``EXAMPLE``, ``add_arguments`` and ``run``. Begin with `main`.
"""
