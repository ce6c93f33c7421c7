"""Check that public functions of two or more arguments document their parameters and what they return, as numpydoc reads it.

    .venv/bin/python tools/check_docstrings.py tracker_node

Prints a line a finding and ends with status 1 where there are any. Names that begin with an underscore, functions within
functions, functions of fewer arguments, and methods that a base class or protocol documents need no sections.
"""

import ast
import sys
from collections.abc import Iterable
from pathlib import Path

from numpydoc.hooks.validate_docstrings import DocstringVisitor

CHECKS = {
    "GL08": "no docstring",
    "PR01": "parameters not documented",
    "PR02": "unknown parameters",
    "PR03": "wrong order of parameters",
    "RT01": "no Returns",
    "YD01": "no Yields",
}


class _Visitor(DocstringVisitor):
    """Findings of public functions and methods of two or more arguments only, without those in ``inherited`` (`overriding`)."""

    inherited: frozenset[tuple[str, str]] = frozenset()

    def visit(self, node: ast.AST) -> None:
        hidden = getattr(node, "name", "").startswith("_")
        if hidden or (self.stack and isinstance(self.stack[-1], ast.FunctionDef | ast.AsyncFunctionDef)):
            return
        super().visit(node)

    def _get_numpydoc_issues(self, node: ast.AST) -> None:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and n_arguments(node, self.stack[-2]) >= 2:
            if (getattr(self.stack[-2], "name", ""), node.name) in self.inherited:
                return
            if not any(ast.unparse(decorator).endswith((".setter", "overload", "override")) for decorator in node.decorator_list):
                super()._get_numpydoc_issues(node)


def n_arguments(function: ast.FunctionDef | ast.AsyncFunctionDef, parent: ast.AST) -> int:
    """Arguments of a function, of a method without the object or class that it is called on.

    Parameters
    ----------
    function : node of the syntax tree.
    parent : the node whose body it stands in.

    Returns
    -------
    Their number; those that gather the rest count as one each.
    """
    args = function.args
    static = any(ast.unparse(decorator) == "staticmethod" for decorator in function.decorator_list)
    bound = isinstance(parent, ast.ClassDef) and not static
    named = len(args.posonlyargs) + len(args.args) + len(args.kwonlyargs)
    return named + (args.vararg is not None) + (args.kwarg is not None) - bound


def overriding(files: Iterable[Path]) -> frozenset[tuple[str, str]]:
    """(class, method) of methods that a base class in these files has, too; its docstring is theirs."""
    classes = [node for file in files for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.ClassDef)]
    methods = {node.name: {f.name for f in node.body if isinstance(f, ast.FunctionDef)} for node in classes}
    bases = {node.name: [ast.unparse(base).split("[")[0].split(".")[-1] for base in node.bases] for node in classes}

    def inherited(name: str) -> set[str]:
        return set().union(*(methods[base] | inherited(base) for base in bases[name] if base in methods and base != name))

    return frozenset((name, method) for name in methods for method in methods[name] & inherited(name))


def findings(file: Path, inherited: frozenset[tuple[str, str]] = frozenset()) -> list[str]:
    """What a file's docstrings lack, a line each.

    Parameters
    ----------
    file : of Python.
    inherited : (class, method) that need no sections (`overriding`).

    Returns
    -------
    Place, name and check.
    """
    visitor = _Visitor(str(file), {"checks": set(CHECKS), "exclude": None, "overrides": None})
    visitor.inherited = inherited
    visitor.visit(ast.parse(file.read_text()))
    return [f"{place}: {name}: {check} {description}" for place, name, check, description in visitor.findings]


def main(paths: list[str]) -> int:
    files = [file for path in map(Path, paths) for file in (sorted(path.rglob("*.py")) if path.is_dir() else [path])]
    inherited = overriding(files)
    found = [line for file in files for line in findings(file, inherited)]
    print(*found, f"{len(found)} findings in {len(files)} files", sep="\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:] or ["tracker_node"]))
