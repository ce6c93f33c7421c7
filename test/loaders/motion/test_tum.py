import numpy as np

from tracker_node.loaders.motion.tum import dump_tum


def test_lines_keep_nanoseconds_and_digits(tmp_path):
    stamps = np.array([1_700_000_000_123_456_789, 1_700_000_000_140_000_001], dtype=np.int64)
    positions = np.array([[1.0 / 3.0, -2.0, 3.0], [0.1, 0.2, 0.3]])
    quaternions = np.array([[0.0, 0.0, 0.6, 0.8], [1.0, 0.0, 0.0, 0.0]])
    dump_tum(stamps, positions, quaternions, tmp_path / "a.txt")
    lines = (tmp_path / "a.txt").read_text().splitlines()
    assert lines[1].split()[0] == "1700000000.123456789"
    table = np.loadtxt(tmp_path / "a.txt")  # as evo and the benchmark's own tools read it: '#' begins a comment
    assert table.shape == (2, 8)
    assert np.array_equal(table[:, 1:4], positions) and np.array_equal(table[:, 4:], quaternions)
