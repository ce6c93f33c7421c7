"""Fixtures that every test may use."""

import fcntl
import gc
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import IO

import pytest
from hypothesis import settings

# How long one example takes says more of what else the machine does than of the code.
settings.register_profile("tracker_node", deadline=None)
settings.load_profile("tracker_node")

ROOT = Path(__file__).resolve().parents[1]
DOMAIN_IDS = range(1, 102)  # those whose ports lie below the ephemeral ones on every platform


@pytest.fixture(scope="session")
def repository() -> Path:
    """The root of the source tree."""
    return ROOT


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of third-party recordings and motions, named by TRACKER_SHARED_DATA."""
    named = os.environ.get("TRACKER_SHARED_DATA")
    if not named:
        pytest.skip("TRACKER_SHARED_DATA does not name the folder of recordings")
    path = Path(named)
    if not path.is_dir():
        pytest.skip(f"TRACKER_SHARED_DATA is not a folder: {path}")
    return path


@pytest.fixture(scope="session")
def opensim() -> ModuleType:
    """OpenSim, where this machine has it, without the log that it would write into the current folder."""
    with pytest.MonkeyPatch.context() as patch:  # it sets paths anew in which child processes would not find ROS any more
        for name in ("PATH", "LD_LIBRARY_PATH", "SIMBODY_HOME"):
            patch.setenv(name, os.environ.get(name, ""))
        module = pytest.importorskip("opensim", reason="no wheel of OpenSim for this machine")
    module.Logger.removeFileSink()
    return module


def _claim_domain_id(folder: Path) -> tuple[int, IO[str]]:
    """A ROS domain id that no other test process of this machine holds, and the file whose lock says so."""
    first = os.getpid() % len(DOMAIN_IDS)
    for offset in range(len(DOMAIN_IDS)):
        domain_id = DOMAIN_IDS[(first + offset) % len(DOMAIN_IDS)]
        lock = (folder / f"tracker_node_test_domain_{domain_id}_{os.getuid()}.lock").open("w")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            lock.close()
            continue
        return domain_id, lock
    raise RuntimeError(f"all {len(DOMAIN_IDS)} ROS domain ids are taken by other test processes")


@pytest.fixture(scope="session", autouse=True)
def ros_domain_id(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """A ROS graph of this test process's own: its domain, this machine only, logs in a temporary folder."""
    domain_id, lock = _claim_domain_id(Path("/tmp"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(domain_id))
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        patch.setenv("ROS_LOG_DIR", str(tmp_path_factory.mktemp("ros_log")))
        yield domain_id
    lock.close()


@pytest.fixture
def fresh_domain_id(ros_domain_id: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A ROS graph in which no test of this process has had a node."""
    domain_id, lock = _claim_domain_id(Path("/tmp"))
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain_id))
    yield domain_id
    lock.close()


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """What is imported and collected stays to the end: the garbage collector need not go through it, neither now nor later."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.hookimpl(trylast=True)
def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Failures are told at once, not only at the end, which a run that is stopped at its time limit never reaches."""
    if report.failed and "PYTEST_XDIST_WORKER" not in os.environ:
        print(f"\n== failed in {report.when}: {report.nodeid}\n{report.longreprtext}", file=sys.__stderr__, flush=True)


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """How the tests ended, beside those that failed: `tools/second_try.py` asks for both."""
    cache = session.config.cache
    if cache is not None and not hasattr(session.config, "workerinput"):
        cache.set("tracker_node/exit_status", int(exitstatus))
