"""Workers of Dask on the loopback, one of which is killed in the middle."""

import pytest

from benchmark import batch as benchmark
from tracker_node.batch.batch import BatchOptions, run_batch
from tracker_node.batch.work import TRACKED
from tracker_node.errors import TrackerError
from tracker_node.loaders.trials_yaml import load_trials


@pytest.mark.long
def test_no_trial_is_lost_with_a_worker_and_states_are_the_same(tmp_path):
    trials = load_trials(benchmark.write_trials(tmp_path, 60, 5))
    with benchmark.dask_cluster(tmp_path, 2) as (address, workers):
        outcomes = benchmark.killed_in_the_middle(trials, address, workers)
        assert workers[0].poll() is None
    assert [outcome.state for outcome in outcomes] == [TRACKED] * 5
    assert benchmark.same_states(trials, tmp_path / "one_by_one")


@pytest.mark.long
def test_a_scheduler_without_workers_says_how_to_start_some(trials_file, tmp_path):
    with benchmark.dask_cluster(tmp_path, 0) as (address, _), pytest.raises(TrackerError, match="dask worker"):
        run_batch(load_trials(trials_file), BatchOptions(scheduler=address))


@pytest.mark.long
def test_ctrl_c_takes_the_work_back(trials_file, tmp_path):
    def interrupt(now):
        raise KeyboardInterrupt

    with benchmark.dask_cluster(tmp_path, 1) as (address, _):
        with pytest.raises(KeyboardInterrupt):
            run_batch(load_trials(trials_file), BatchOptions(scheduler=address), progress=interrupt)
        assert len(run_batch(load_trials(trials_file), BatchOptions(scheduler=address))) == 3
