"""Progress on a terminal."""

from tracker_node.report.progress import say


def test_lines_are_said_on_stderr(capsys):
    say("half done")
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err == "half done\n"
