"""The benchmark of the synchronizer: what must hold in every situation, and the files that it writes."""

import json

from benchmark.ros import synchronizer


def test_table(tmp_path, capsys):
    assert synchronizer.main(["--json", str(tmp_path / "sync.json"), "--markdown", str(tmp_path / "sync.md")]) == 0
    figures = json.loads((tmp_path / "sync.json").read_text())["metrics"]
    rows = {name: {} for name in (situation.name for situation in synchronizer.situations())}
    for key, value in figures.items():
        name = next(name for name in sorted(rows, key=len, reverse=True) if key.startswith(f"synchronizer.{name}."))
        rows[name][key.removeprefix(f"synchronizer.{name}.")] = value
    for name, row in rows.items():
        assert (row["mixed"], row["unaccounted"]) == (0, 0), name
    for name in (
        "ideal",
        "stamps_jitter",
        "one_300ms_late",
        "one_300ms_late_all_needed",
        "tenth_doubled",
        "free_running_tolerance_0.8",
    ):
        assert rows[name]["complete"] == 600, name
    assert rows["one_300ms_late"]["latency_ms_max"] < 301.0
    assert rows["one_beyond_queue"]["of_fewer"] == 600 and rows["one_beyond_queue"]["latency_ms_p95"] < 70.0
    assert rows["tenth_reordered"]["complete"] > 580
    assert rows["all_pause_4s"]["complete"] == rows["all_pause_4s"]["instants"]
    table = (tmp_path / "sync.md").read_text()
    assert table == capsys.readouterr().out and table.count("\n") == 2 + len(rows)
