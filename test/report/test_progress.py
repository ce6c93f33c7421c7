"""Progress on a terminal and in a file."""

import io

from tracker_node.report.progress import ByteProgress, say


class Terminal(io.StringIO):
    def isatty(self):
        return True


def lines(output, calls):
    progress = ByteProgress(output)
    for call in calls:
        progress(*call)
    return output.getvalue()


def test_lines_are_said_on_stderr(capsys):
    say("half done")
    ByteProgress()("clip", 1, 2)
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err == "half done\n  clip:   0.0 of 0.0 MB ( 50 %)\n"


def test_a_file_gets_a_line_at_every_tenth():
    million = 10**6
    told = lines(io.StringIO(), [("clip", done * million, 200 * million) for done in (4, 18, 19, 20, 38, 40, 199, 200, 200)])
    assert told.splitlines() == [
        "  clip:   4.0 of 200.0 MB (  2 %)",
        "  clip:  20.0 of 200.0 MB ( 10 %)",
        "  clip:  40.0 of 200.0 MB ( 20 %)",
        "  clip: 199.0 of 200.0 MB ( 99 %)",
        "  clip: 200.0 of 200.0 MB (100 %)",
    ]


def test_another_download_begins_anew():
    told = lines(io.StringIO(), [("a", 50, 100), ("b", 50, 100), ("b", 51, 100)])
    assert [line.split(":")[0].strip() for line in told.splitlines()] == ["a", "b"]
    told = lines(Terminal(), [("a", 100, 100), ("b", 100, 100)])
    assert told == "\r  a:   0.0 of 0.0 MB (100 %)\n\r  b:   0.0 of 0.0 MB (100 %)\n"


def test_on_a_terminal_the_line_ends_once():
    told = lines(Terminal(), [("a", 99, 100), ("a", 100, 100), ("a", 100, 100)])
    assert told.count("\r") == 3 and told.count("\n") == 1 and told.index("\n") > told.index("100 %")


def test_a_download_of_nothing_is_no_error():
    assert lines(io.StringIO(), [("a", 0, 0)]) == "  a:   0.0 of 0.0 MB (  0 %)\n"
