"""``make docs``: the pages and the reference become a site, with no ROS; a link that leads nowhere fails the build."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

BLOCKED = ("rclpy", "sensor_msgs", "geometry_msgs", "std_msgs", "tracker_msgs", "visualization_msgs", "diagnostic_msgs")
PROGRAM = """
import runpy, sys
sys.modules.update(dict.fromkeys({blocked}))
sys.argv = [{program!r}, *{arguments}]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


def build(root: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    program = PROGRAM.format(blocked=BLOCKED, program=str(root / "tools/site/build.py"), arguments=list(arguments))
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)


def test_pages_and_the_reference_of_a_package_become_a_site(repository, tmp_path):
    done = build(repository, "--api", "tracker_node.camera", "--output", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert {path.stem for path in (repository / "docs").glob("*.md")} <= {path.stem for path in tmp_path.glob("*.html")}
    page = (tmp_path / "api/tracker_node.camera.html").read_text()
    assert 'id="tracker_node.camera.rig.CameraRig"' in page
    assert re.search(r"<dt[^>]*>Parameters<", page)  # numpydoc is understood
    assert "camerarig" in (tmp_path / "searchindex.js").read_text()


def test_a_link_that_leads_nowhere_fails_the_build(repository, tmp_path):
    for name in ("docs", "tools/site"):
        shutil.copytree(repository / name, tmp_path / name)
    with (tmp_path / "docs/index.md").open("a") as file:
        file.write("\n[nowhere](nowhere.md) [no heading](install.md#nothing-of-the-kind)\n")
    done = build(tmp_path, "--api", "", "--output", str(tmp_path / "site"))
    assert done.returncode != 0
    assert "nowhere.md" in done.stderr and "nothing-of-the-kind" in done.stderr


@pytest.mark.long
def test_every_public_module_is_in_the_reference(repository, tmp_path):
    done = build(repository, "--output", str(tmp_path))
    assert done.returncode == 0, done.stderr
    pages = "".join(path.read_text() for path in (tmp_path / "api").glob("*.html"))
    for module in (repository / "tracker_node").rglob("*.py"):
        parts = module.relative_to(repository).with_suffix("").parts
        if parts[1] in ("ros", "cli") or any(part.startswith("_") for part in parts):
            continue
        assert f'id="module-{".".join(parts)}"' in pages, module
