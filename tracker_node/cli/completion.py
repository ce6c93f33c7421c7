"""``tracker_node completion``: the script by which a shell asks this program for verbs, options and choices (argcomplete)."""

from __future__ import annotations

import argparse

SUMMARY = "print the script that lets a shell complete verbs, options and choices"
EXAMPLE = "tracker_node completion bash"
SHELLS = ("bash", "zsh", "fish")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=SHELLS, help="the shell; in bash: source <(tracker_node completion bash)")


def run(args: argparse.Namespace) -> int:
    from argcomplete import shellcode

    print(shellcode(["tracker_node"], True, args.shell))
    return 0
