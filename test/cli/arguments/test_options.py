"""Options that every command has alike."""

import argparse
import importlib
from collections.abc import Iterator

import pytest

from tracker_node.cli.main import module_of, parser_of, verbs

OTHER_NAMES = ("--out", "--output-folder", "--output-file", "--outdir")


def parsers(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    yield parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for inner in action.choices.values():
                yield from parsers(inner)


@pytest.mark.parametrize("verb", verbs())
def test_what_writes_has_output_and_its_short_form(verb):
    module = importlib.import_module(module_of(verb))
    for parser in parsers(parser_of(verb, module)):
        options = parser._option_string_actions
        assert ("-o" in options) == ("--output" in options), parser.prog
        assert options.get("-o") is options.get("--output"), parser.prog
        assert not set(OTHER_NAMES).intersection(options), parser.prog


def test_the_commands_that_write_are_among_them():
    with_output = {
        parser.prog.removeprefix("tracker_node ")
        for verb in verbs()
        for parser in parsers(parser_of(verb, importlib.import_module(module_of(verb))))
        if "-o" in parser._option_string_actions
    }
    assert {"demo", "track", "pipeline", "recorder", "evaluate", "export", "bag repair", "calibrate rig"} <= with_output
