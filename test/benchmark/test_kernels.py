"""The kernel benchmark runs, and measures what it says."""

import json
import time

import pytest

from benchmark import kernels


def test_figures_of_every_kernel():
    metrics = kernels.measure(seconds=0.0, threads=False)
    names = kernels.make_cases(kernels.make_scene())
    for name in names:
        p50, p95 = metrics[f"kernels.{name}.ms_p50"], metrics[f"kernels.{name}.ms_p95"]
        assert 0 < p50 <= p95
        assert metrics[f"kernels.{name}.per_reference"] == pytest.approx(p50 / metrics["kernels.reference_ms"])
    assert 0.1 < metrics["kernels.region_share"] < 0.35
    assert 0.03 < metrics["kernels.body_share"] < metrics["kernels.region_share"]


def test_times_are_times():
    times = kernels.times_ms(lambda: time.sleep(0.003), 0.05)
    assert len(times) >= 10
    assert times.min() >= 3.0


def test_writes_json(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(kernels, "measure", lambda seconds: {"kernels.x.ms_p50": seconds})
    assert kernels.main(["--quick", "--json", str(tmp_path / "kernels.json")]) == 0
    assert json.loads((tmp_path / "kernels.json").read_text())["metrics"] == {"kernels.x.ms_p50": 0.1}
    assert "kernels.x.ms_p50" in capsys.readouterr().out
