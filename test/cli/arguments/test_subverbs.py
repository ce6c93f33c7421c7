"""Verbs that are made of others."""

import argparse

import pytest

from tracker_node.cli.arguments.verbs import add_subverbs, run_subverb, subverbs
from tracker_node.cli.bag import info as _bag_info


def parser():
    made = argparse.ArgumentParser(prog="tracker_node bag")
    add_subverbs(made, "bag")
    return made


def test_names_are_those_of_the_modules_in_order():
    names = subverbs("bag")
    assert "info" in names and names == sorted(names) and not any("_bag_" in name or name.startswith("_") for name in names)
    assert "body" in subverbs("calibrate") and "body" not in names
    assert subverbs("juggle") == []


def test_the_one_that_is_asked_for_is_run(tmp_path):
    args = parser().parse_args(["info", str(tmp_path)])
    assert args.what == "info" and args.run_subverb is _bag_info.run and args.bag == tmp_path
    args.run_subverb = lambda given: 7 if given is args else 0
    assert run_subverb(args) == 7


def test_one_has_to_be_asked_for(capsys):
    for given in ([], ["another"]):
        with pytest.raises(SystemExit):
            parser().parse_args(given)
    assert "{" + ",".join(subverbs("bag")) + "}" in capsys.readouterr().err


def test_each_has_its_help(capsys):
    with pytest.raises(SystemExit):
        parser().parse_args(["info", "--help"])
    told = capsys.readouterr().out
    assert _bag_info.SUMMARY in told.replace("\n", " ") and f"example:\n  {_bag_info.EXAMPLE}" in told
    assert "usage: tracker_node bag info" in told
    with pytest.raises(SystemExit):
        parser().parse_args(["--help"])
    assert _bag_info.SUMMARY[:30] in capsys.readouterr().out
