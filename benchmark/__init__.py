"""Programs that measure: each prints its metrics, and writes them as JSON with --json.

Files that begin with an underscore are helpers of the programs beside them.
"""
