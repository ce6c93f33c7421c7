"""Verbs that are made of others."""

import argparse

import pytest

from tracker_node.cli.arguments.verbs import add_subverbs, run_subverb
from tracker_node.cli.groups import bag, calibrate


def parser():
    made = argparse.ArgumentParser(prog="tracker_node bag")
    add_subverbs(made, bag.SUBVERBS)
    return made


INFO = next(each for each in bag.SUBVERBS if each.name == "info")


def names(module):
    return [each.name for each in module.SUBVERBS]


def test_names_are_in_order():
    assert names(bag) == ["check", "info", "repair"]
    assert "body" in names(calibrate) and names(calibrate) == sorted(names(calibrate))


def test_the_one_that_is_asked_for_is_run(tmp_path):
    args = parser().parse_args(["info", str(tmp_path)])
    assert args.what == "info" and args.run_subverb is INFO.run and args.bag == tmp_path
    args.run_subverb = lambda given: 7 if given is args else 0
    assert run_subverb(args) == 7


def test_one_has_to_be_asked_for(capsys):
    for given in ([], ["another"]):
        with pytest.raises(SystemExit):
            parser().parse_args(given)
    assert "{" + ",".join(names(bag)) + "}" in capsys.readouterr().err


def test_each_has_its_help(capsys):
    with pytest.raises(SystemExit):
        parser().parse_args(["info", "--help"])
    told = capsys.readouterr().out
    assert INFO.summary in told.replace("\n", " ") and f"example:\n  {INFO.example}" in told
    assert "usage: tracker_node bag info" in told
    with pytest.raises(SystemExit):
        parser().parse_args(["--help"])
    assert INFO.summary[:30] in capsys.readouterr().out
