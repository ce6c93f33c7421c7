"""Progress on a terminal."""

from tracker_node.report.progress import StageProgress, say


def test_lines_are_said_on_stderr(capsys):
    say("half done")
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err == "half done\n"


def test_progress_is_a_line_for_the_beginning_and_the_end_of_a_stage(capsys):
    progress = StageProgress("calibrate rig")
    for what, done, total in (("looking", 1, 3), ("looking", 2, 3), ("looking", 3, 3), ("fitting", 1, 9)):
        progress(what, done, total)
    lines = capsys.readouterr().err.splitlines()
    assert [line.rsplit(",", 1)[0] for line in lines] == [
        "calibrate rig: looking, 1 of 3", "calibrate rig: looking, 3 of 3", "calibrate rig: fitting, 1 of 9",
    ]  # fmt: skip
