"""Nothing from outside is run or leads outside: sources without dangerous calls, archives, bags, names in files, the studio."""

import ast
import base64
import json
import os
import socket
import zipfile
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import yaml

from helpers.bodies.bodies import crane
from helpers.cameras.small_clip import make_clip
from helpers.sources.bag_samples import fill
from helpers.studio.studio_process import running_studio
from tracker_node.cli.main import main
from tracker_node.errors import FileFormatError
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.bag.writer import BagWriter
from tracker_node.loaders.keypoints.formats import load_points
from tracker_node.loaders.model.model_yaml import dump_model, load_model

PATIENCE_S, MORE_S = 3.0, 0.5  # for the first byte, and after one
SOURCES = ("tracker_node", "tools", "benchmark", "launch", "msgs")
FORBIDDEN_MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "shelve", "marshal", "telnetlib", "xmlrpc"}
FORBIDDEN_NAMES = {"eval", "exec", "__import__"}
FORBIDDEN_CALLS = {
    "os.system", "os.popen", "yaml.unsafe_load", "yaml.full_load", "yaml.load_all", "yaml.unsafe_load_all", "np.fromregex",
    "shutil.unpack_archive", "pd.read_pickle", "tempfile.mktemp", "subprocess.getoutput", "subprocess.getstatusoutput",
}  # fmt: skip
READS_NUMBERS_ONLY = {"opencap_pickle.py": ["pickle"]}  # its unpickler makes nothing else (test_opencap_pickle)
KEYWORDS = {"Loader", "allow_pickle", "filter", "shell"}
SAFE_LOADERS = {"_StrictLoader", "yaml.BaseLoader", "yaml.SafeLoader", "yaml.CSafeLoader"}


def dangers(source: str) -> list[str]:
    """Calls and imports by which what a file holds could be run, or a file written anywhere."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names if alias.name.split(".")[0] in FORBIDDEN_MODULES]
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in FORBIDDEN_MODULES:
            found.append(str(node.module))
        elif isinstance(node, ast.Call):
            found += _dangers_of_call(node)
    return found


def _dotted(function: ast.expr) -> str:
    """``np.load`` of such a call; nothing where a name is computed."""
    if isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name):
        return f"{function.value.id}.{function.attr}"
    return function.id if isinstance(function, ast.Name) else ""


def _dangers_of_call(node: ast.Call) -> list[str]:
    name, last = _dotted(node.func), getattr(node.func, "attr", "")
    given = {keyword.arg: ast.unparse(keyword.value) for keyword in node.keywords if keyword.arg in KEYWORDS}
    found = [name] if name in FORBIDDEN_NAMES | FORBIDDEN_CALLS else []
    if name == "yaml.load" and given.get("Loader") not in SAFE_LOADERS:
        found.append("yaml.load")
    if name in ("np.load", "numpy.load") and given.get("allow_pickle") != "False":
        found.append("np.load without allow_pickle=False")
    if last in ("extract", "extractall") and "filter" not in given:
        found.append(name)
    if given.get("shell", "False") != "False":
        found.append(f"{name} with a shell")
    return found


@pytest.mark.parametrize("folder", SOURCES)
def test_no_source_calls_anything_dangerous(folder, repository):
    files = sorted((repository / folder).rglob("*.py"))
    found = {str(file): dangers(file.read_text(encoding="utf-8")) for file in files}
    assert {file: calls for file, calls in found.items() if calls and calls != READS_NUMBERS_ONLY.get(Path(file).name)} == {}


@pytest.mark.parametrize(
    "source",
    ["import pickle", "from shelve import open", "yaml.load(x)", "yaml.load(x, Loader=yaml.Loader)", "np.load(f)", "eval(x)",
     "archive.extractall(p)", "subprocess.run(x, shell=True)", "os.system(x)"],
)  # fmt: skip
def test_the_scan_sees_them(source):
    assert dangers(source)


def test_objects_of_python_in_yaml_are_refused(tmp_path):
    trace, path = tmp_path / "run", tmp_path / "model.yaml"
    path.write_text(f"name: !!python/object/apply:os.mkdir ['{trace}']\n")
    with pytest.raises(FileFormatError, match=r"model\.yaml"):
        load_model(path)
    assert not trace.exists()


def test_an_archive_of_joints_writes_nothing(tmp_path):
    archive = tmp_path / "in" / "points2d.zip"
    archive.parent.mkdir()
    with zipfile.ZipFile(archive, "w") as writer:
        for name in ("../outside.json", "/tmp/outside_tracker.json", "cam01/000.json"):
            writer.writestr(name, json.dumps({"people": []}))
    before = sorted(tmp_path.rglob("*"))
    load_points(archive)
    assert sorted(tmp_path.rglob("*")) == before
    assert not Path("/tmp/outside_tracker.json").exists()


def test_an_archive_that_unpacks_to_gigabytes_is_refused(tmp_path):
    archive = tmp_path / "points2d.zip"
    with (
        zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as writer,
        writer.open("cam01/000.json", "w", force_zip64=True) as member,
    ):
        for _ in range(80):
            member.write(b" " * 2**20)
    assert archive.stat().st_size < 2**20
    with pytest.raises(FileFormatError, match=r"points2d\.zip"):
        load_points(archive)


@pytest.mark.parametrize("elsewhere", ["../secret.mcap", "{absolute}"])
def test_metadata_of_a_bag_lead_nowhere_else(tmp_path, elsewhere):
    """A bag that says its messages are in a file of another folder."""
    for name in ("bag", "other"):
        with BagWriter(tmp_path / name) as writer:
            fill(writer, 2)
    secret = tmp_path / "secret.mcap"
    (tmp_path / "other" / "other_0.mcap").rename(secret)
    metadata = tmp_path / "bag" / "metadata.yaml"
    said = yaml.safe_load(metadata.read_text())
    information = said["rosbag2_bagfile_information"]
    information["relative_file_paths"] = [elsewhere.format(absolute=secret)]
    for file in information["files"]:
        file["path"] = elsewhere.format(absolute=secret)
    metadata.write_text(yaml.safe_dump(said))
    (tmp_path / "bag" / "bag_0.mcap").unlink()
    with pytest.raises(FileFormatError, match="bag"), BagReader(tmp_path / "bag") as reader:
        list(reader.messages())


def test_names_in_a_model_are_no_paths(tmp_path):
    """A shape may be called what it likes; what is written for it stays in the folder."""
    dump_model(crane(), tmp_path / "in" / "model.yaml")
    text = (tmp_path / "in" / "model.yaml").read_text().replace("\n  plate:", "\n  '../../../plate':")
    (tmp_path / "in" / "model.yaml").write_text(text)
    model = load_model(tmp_path / "in" / "model.yaml")
    assert any(shape.name == "../../../plate" for shape in model.shapes)
    out = tmp_path / "a" / "b" / "out"
    dump_model(model, out / "model.yaml")
    assert all(path.parent == out for path in tmp_path.rglob("*") if path.is_file() and path.parent.name != "in")
    again = load_model(out / "model.yaml")
    assert [shape.name for shape in again.shapes] == [shape.name for shape in model.shapes]


def test_a_rig_with_paths_for_names_is_refused(tmp_path, capsys):
    rig = tmp_path / "rig.yaml"
    entry = {"image_size": [4, 3], "K": [[5, 0, 2], [0, 5, 1], [0, 0, 1]], "T_world_cam": [[1, 0, 0, 0], [0, 1, 0, 0]]}
    entry["T_world_cam"] += [[0, 0, 1, 0], [0, 0, 0, 1]]
    rig.write_text(yaml.safe_dump({"cameras": {"../../cam": entry}}))
    assert main(["rig", "export", str(rig), "--to", "camera_info", "--output", str(tmp_path / "out")]) == 2
    assert "rig.yaml" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


class Outsider:
    """Bytes to the studio, as they are."""

    def __init__(self, url: str):
        parts = urlsplit(url)
        self.port, self.token = parts.port, parts.query.split("token=")[1]
        self.cookie = f"Cookie: studio_{self.port}={self.token}"

    def send(self, *lines: str | bytes, body: bytes = b"") -> bytes:
        """What the server says to these header lines until it closes; where they do not ask for that, until it says no more."""
        patience_s, more_s = (60.0, 60.0) if "Connection: close" in lines else (PATIENCE_S, MORE_S)
        head = b"\r\n".join(line.encode("latin-1") if isinstance(line, str) else line for line in lines)
        answer = b""
        with socket.create_connection(("127.0.0.1", self.port), timeout=patience_s) as connection:
            try:
                connection.sendall(head + b"\r\n\r\n" + body)
                while chunk := connection.recv(65536):
                    answer += chunk
                    connection.settimeout(more_s)
            except (ConnectionError, TimeoutError):  # it has heard enough
                pass
        return answer

    def status(self, *lines: str | bytes, body: bytes = b"") -> int:
        answer = self.send(*lines, body=body)
        return int(answer.split()[1]) if answer.startswith(b"HTTP/") else 0

    def works(self) -> bool:
        """It still answers those who may ask."""
        return self.status("GET /api/session HTTP/1.1", f"Host: 127.0.0.1:{self.port}", self.cookie, "Connection: close") == 200


@pytest.fixture(scope="module")
def outsider(tmp_path_factory):
    clip = make_clip(tmp_path_factory.mktemp("studio"), n_images=1)
    outside = clip.folder / "outside.yaml"
    outside.write_text(clip.state_file.read_text())
    (clip.folder / "poses").mkdir()
    os.symlink(outside, clip.folder / "poses" / "link.yaml")
    with running_studio("--rig", clip.rig_file, "--model", clip.model_file, "--folder", clip.folder / "poses") as studio:
        yield Outsider(studio.url)


def test_sockets_from_elsewhere_are_refused(outsider):
    key = base64.b64encode(bytes(16)).decode()
    upgrade = ("Upgrade: websocket", "Connection: Upgrade", f"Sec-WebSocket-Key: {key}", "Sec-WebSocket-Version: 13")
    host = f"Host: 127.0.0.1:{outsider.port}"
    for origin in ("Origin: http://evil.example", "Origin: null", f"Origin: http://localhost:{outsider.port}.evil.example"):
        assert outsider.status("GET /api/live/stream HTTP/1.1", host, outsider.cookie, *upgrade, origin) == 403
    own = f"Origin: http://127.0.0.1:{outsider.port}"
    assert outsider.status("GET /api/live/stream HTTP/1.1", host, *upgrade, own) == 403  # without the token
    assert outsider.status("GET /api/live/stream HTTP/1.1", "Host: evil.example", outsider.cookie, *upgrade, own) == 403


@pytest.mark.parametrize(
    "lines",
    [
        ("GET /api/session HTTP/1.1",),  # no host
        ("GET /api/session HTTP/1.1", "Host: 127.0.0.1:{port}", "Host: evil.example", "{cookie}"),
        ("GET http://evil.example/api/session HTTP/1.1", "Host: evil.example", "{cookie}"),
        ("CONNECT evil.example:443 HTTP/1.1", "Host: evil.example:443", "{cookie}"),
        ("GET /api/session HTTP/1.1", "Host: 127.0.0.1:{port}@evil.example", "{cookie}"),
        ("POST /api/pose/save HTTP/1.1", "Host: 127.0.0.1:{port}", "{cookie}", "Content-Length: 2", "Content-Length: 200"),
        ("GET /" + "a" * 200_000 + " HTTP/1.1", "Host: 127.0.0.1:{port}"),
        ("\x00\x01\x02", "\x16\x03\x01"),
    ],
)
def test_malformed_requests_get_nothing(outsider, lines):
    values = {"port": outsider.port, "cookie": outsider.cookie}
    answer = outsider.send(*(line.format(**values) if "{" in line else line for line in lines))
    assert b" 200 " not in answer.split(b"\r\n")[0]
    assert b"cam01" not in answer
    assert outsider.works()


@pytest.mark.parametrize(
    ("path", "content"),
    [
        ("/api/pose/load", {"name": "link.yaml"}),
        ("/api/pose/load", {"name": "../outside.yaml"}),
        ("/api/pose/load", {"name": "/etc/passwd"}),
        ("/api/pose/save", {"name": "../stolen", "values": [0.0] * 9, "set": 0}),
        ("/api/pose/save", {"name": "link.yaml", "values": [0.0] * 9, "set": 0, "overwrite": True}),
        ("/api/pose/show", {"values": [1e308] * 9}),
        ("/api/digitizing/point", {"name": "../../x\n,=cmd()"}),
    ],
)
def test_names_lead_nowhere_else(outsider, path, content):
    own = (f"Host: 127.0.0.1:{outsider.port}", f"Origin: http://127.0.0.1:{outsider.port}", outsider.cookie)
    body = json.dumps(content).encode()
    status = outsider.status(f"POST {path} HTTP/1.1", *own, f"Content-Length: {len(body)}", "Connection: close", body=body)
    assert status in (400, 404, 409, 422)
    assert outsider.works()


def test_deep_and_large_bodies_are_answered(outsider):
    own = (f"Host: 127.0.0.1:{outsider.port}", f"Origin: http://127.0.0.1:{outsider.port}", outsider.cookie)
    many = b'{"values": [' + b"1," * 2_000_000 + b"1]}"
    for body in (b"[" * 200_000, b'{"values":' + b"[" * 50_000, many, b"\xff\xfe" * 1000):
        status = outsider.status(
            "POST /api/pose/show HTTP/1.1", *own, f"Content-Length: {len(body)}", "Connection: close", body=body
        )
        assert status in (400, 413)
    assert outsider.works()


def test_many_who_say_nothing_do_not_keep_it_busy(outsider):
    idle = [socket.create_connection(("127.0.0.1", outsider.port), timeout=5) for _ in range(100)]
    try:
        assert outsider.works()
    finally:
        for connection in idle:
            connection.close()


def test_only_the_loopback_listens(outsider):
    addresses = {row.split()[1] for row in Path("/proc/net/tcp").read_text().splitlines()[1:] if row.split()[3] == "0A"}
    mine = [address for address in addresses if int(address.partition(":")[2], 16) == outsider.port]
    assert mine == [f"0100007F:{outsider.port:04X}"]
