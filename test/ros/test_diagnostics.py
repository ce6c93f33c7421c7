"""Diagnostics: once a second, and at once when something changes."""

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from tracker_node.ros.diagnostics import ERROR, OK, Diagnostics


def test_changes_go_out_at_once_values_with_the_next_round(probe):
    arrays = probe.listen(DiagnosticArray, "/diagnostics")
    diagnostics = Diagnostics(probe.node, "rig", period_s=3600.0)
    probe.spin_until(lambda: diagnostics._publisher.get_subscription_count() == 2, "subscriptions")
    diagnostics.report("cam1", ERROR, "gone", {"rate": 1.23456, "images": 7})
    probe.spin_until(lambda: len(arrays) == 1, "the change")
    (status,) = arrays[0].status
    assert (status.name, status.level, status.message) == ("probe: cam1", DiagnosticStatus.ERROR, "gone")
    assert {v.key: v.value for v in status.values} == {"rate": "1.235", "images": "7"}
    diagnostics.report("cam1", ERROR, "gone", {"images": 8})  # no change: not before the next round
    diagnostics.report("cam1", OK, "back")
    probe.spin_until(lambda: len(arrays) == 2, "the recovery")
    assert arrays[1].status[0].level == DiagnosticStatus.OK


def test_trouble_is_logged_once_however_its_numbers_change(probe, monkeypatch):
    diagnostics = Diagnostics(probe.node, "tracker", period_s=3600.0)
    logged = []
    monkeypatch.setattr(diagnostics, "_log", lambda part, level, message: logged.append(message))
    for message in ("residual 7.1 px in cam01", "residual 12.9 px in cam01", "residual 12.9 px in cam02"):
        diagnostics.report("status", ERROR, message)
    diagnostics.report("status", OK, "residual 1.0 px in cam02")
    assert logged == ["residual 7.1 px in cam01", "residual 12.9 px in cam02", "residual 1.0 px in cam02"]
