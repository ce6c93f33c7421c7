"""Options of version 0.1 are refused with a line that has their present names."""

import pytest

from tracker_node.cli.main import main


@pytest.mark.parametrize(
    ("command", "now"),
    [
        (["track", "recording.yaml", "--through-masks"], "unknown option --through-masks: it is --masked-images now"),
        (
            ["calibrate", "background", "--rig", "r.yaml", "--stills", "a"],
            "unknown option --stills: it is --background-images now",
        ),
        (["calibrate", "background", "--rig", "r.yaml", "--stills=a"], "unknown option --stills: it is --background-images now"),
        (["synthesize", "--output", "a", "--no-plates"], "unknown option --no-plates: it is --no-backgrounds now"),
        (["calibrate", "texture", "--picture", "a.png"], "unknown option --picture: it is --image now"),
        (["calibrate", "texture", "--marker-share=0.7"], "unknown option --marker-share: it is --marker-ratio now"),
        (["track", "recording.yaml", "--thorough"], "unrecognized arguments: --thorough"),
    ],
)
def test_the_message_has_the_present_name(command, now, capsys):
    with pytest.raises(SystemExit) as end:
        main(command)
    assert end.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"error: {now} (tracker_node {command[0]}" in line
