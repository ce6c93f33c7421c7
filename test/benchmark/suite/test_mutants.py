"""The faults that are planted to try the tests, and which tests they are tried on."""

import ast
from pathlib import Path

import pytest

from benchmark.suite._equivalent_mutants import EQUIVALENT
from benchmark.suite._mutant_tests import Imports, is_program, users_of_kernels
from benchmark.suite._mutation import draw, mutants
from benchmark.suite.mutants import EACH, NAMED

SOURCE = b'''"""Words - and more."""
LIMIT = 5

class Thing:
    size: int = 3

    def area(self, a: int = 2, *rest) -> "x - y":
        """Not 1 - 1."""
        if a < len(rest) and not self.empty:
            raise ValueError(f"{a + 1}" + "text")
        log.info("is %d", a - 1)
        return cross(a + 2.0 * self.b, -self.c)
'''


def changes(source: bytes) -> set[tuple[str, str]]:
    return {(one.kind, one.after) for one in mutants("thing.py", source)}


def test_faults_of_each_kind_are_found_and_only_where_they_belong() -> None:
    assert changes(SOURCE) == {
        ("comparison", "if a >= len(rest) and not self.empty:"),
        ("comparison", "if a <= len(rest) and not self.empty:"),
        ("condition", "if (not self.empty):"),
        ("condition", "if (a < len(rest)):"),
        ("condition", "if a < len(rest) and self.empty:"),
        ("sign", "return cross(a - 2.0 * self.b, -self.c)"),
        ("term", "return cross(a, -self.c)"),
        ("factor", "return cross(a + self.b, -self.c)"),
        ("sign", "return cross(a + 2.0 * self.b, self.c)"),
        ("arguments", "return cross(-self.c, a + 2.0 * self.b)"),
    }


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (b"def f(x):\n    return x[1:]\n", ("one", "return x[2:]")),
        (b"def f(x):\n    x += 2.5\n", ("sign", "x -= 2.5")),
        (b"def f(x):\n    return np.radians(x)\n", ("factor", "return x")),
        (b"def f(x):\n    return x / 255.0\n", ("factor", "return x")),
        (b"def f(x):\n    return 1 if x else 2\n", ("condition", "return 1")),
        (b"def f(x):\n    if x:\n        g()\n", ("condition", "if True:")),
        (b"def f(x):\n    return x is not None\n", ("comparison", "return x is None")),
        (b"def f(x):\n    return (x) - (\n        y)\n", ("sign", "return (x) + (")),
    ],
)
def test_a_fault_changes_the_text_of_one_expression(before: bytes, after: tuple[str, str]) -> None:
    assert after in changes(before)


def test_the_draw_goes_by_seed_and_takes_kinds_in_turn() -> None:
    first = draw("thing.py", SOURCE, 6, seed=3)
    assert first == draw("thing.py", SOURCE, 6, seed=3)
    assert first != draw("thing.py", SOURCE, 6, seed=4)
    assert {one.kind for one in first} == {"comparison", "condition", "sign", "term", "factor", "arguments"}
    for one in first:
        changed = one.applied(SOURCE).decode().splitlines()[one.line - 1]
        assert changed.strip() == one.after and one.function == "Thing.area"


def test_tests_are_tried_by_name_and_nearness(tmp_path: Path) -> None:
    for name, text in {
        "tracker_node/__init__.py": "",
        "tracker_node/a/__init__.py": "",
        "tracker_node/a/kernel.py": "@compiled\ndef deep(x):\n    return x\n\n@compiled\ndef outer(x):\n    return deep(x)\n",
        "tracker_node/a/user.py": "from .kernel import outer\n\nclass User:\n    def call(self):\n        return outer(1)\n",
        "tracker_node/b.py": "from .a.user import User\n\ndef far():\n    return User().call()\n",
        "test/b/test_far.py": "from tracker_node.b import far\n",
        "test/a/test_near.py": "def test():\n    from tracker_node.a import kernel\n    kernel.deep()\n",
        "test/b/test_kernel.py": "import helper\n",
        "test/helper.py": "from tracker_node.a.user import User\n",
        "test/b/test_other.py": "import json\n",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    imports = Imports(tmp_path)
    nearest = ["test/b/test_kernel.py", "test/a/test_near.py", "test/b/test_far.py"]
    assert imports.test_files("tracker_node/a/kernel.py") == nearest
    assert imports.test_files("tracker_node/a/user.py") == ["test/b/test_far.py", "test/b/test_kernel.py"]
    users = users_of_kernels(imports)["tracker_node/a/kernel.py", "deep"]
    assert users == {("tracker_node/a/user.py", "User.call"), ("test/a/test_near.py", "test")}


def test_a_file_that_says_what_a_module_is_called_is_tried_before_others_as_near(tmp_path: Path) -> None:
    for name, text in {
        "tracker_node/__init__.py": "",
        "tracker_node/a/_fit_body.py": "def fitted():\n    pass\n",
        "tracker_node/a/main.py": "from . import _fit_body\n",
        "test/a/test_all.py": "from tracker_node.a import main\n",
        "test/a/test_calls.py": "from tracker_node.a import main\nmain.other.fitted()\n",
        "test/a/test_half.py": "from tracker_node.a import main\nmain('body')\n",
        "test/b/test_words.py": "from tracker_node.a import main\nmain('fit body')\n",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    nearest = ["test/a/test_calls.py", "test/b/test_words.py", "test/a/test_half.py", "test/a/test_all.py"]
    assert Imports(tmp_path).test_files("tracker_node/a/_fit_body.py") == nearest


def test_programs_are_told_from_modules() -> None:
    assert is_program(ast.parse("def main():\n    pass\n\nif __name__ == '__main__':\n    main()\n"))
    assert not is_program(ast.parse("def main():\n    if __name__:\n        pass\n"))


@pytest.mark.parametrize("name", NAMED)
def test_a_named_module_is_there_and_has_enough_faults(repository: Path, name: str) -> None:
    path = f"tracker_node/{name}.py"
    source = (repository / path).read_bytes()
    assert len(draw(path, source, EACH[False], 1)) == EACH[False]


def test_the_sizes_of_markers_are_among_the_faults(repository: Path) -> None:
    """An ellipsoid of half its size was among the first that no test noticed."""
    path = next(f"tracker_node/{name}.py" for name in NAMED if name.startswith("runs/messages"))
    assert any("_SPHERE, np.array(primitive.radii" in one.after for one in mutants(path, (repository / path).read_bytes()))


def test_every_equivalent_fault_can_still_be_drawn_and_has_a_reason(repository: Path) -> None:
    for (path, before, after), reason in EQUIVALENT.items():
        found = mutants(path, (repository / path).read_bytes())
        assert any((one.before, one.after) == (before, after) for one in found), f"{path}: {before}"
        assert reason.endswith(".") and len(reason) > 20
