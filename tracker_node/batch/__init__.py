"""Many trials tracked on several processes or machines, with one report over all of them.

`work` tracks one trial, wherever it is called; `executors` call it, in processes of this machine or on workers of Dask; `batch`
shares trials out and goes on where an earlier call ended; `report` is about all of them together. Begin with `batch`. What a
trial is stands in `loaders.trials_yaml`.
"""
