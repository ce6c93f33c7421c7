"""``tracker_node completion``: the script by which a shell completes verbs, options and their choices."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, field

SUMMARY = "print the script that lets a shell complete verbs, options and choices"
EXAMPLE = "tracker_node completion bash"
SHELLS = ("bash", "zsh", "fish")
PROGRAM = "tracker_node"


@dataclass
class Words:
    """What may follow a verb, or a verb and its sub-verb.

    Parameters
    ----------
    key : ``export``, ``calibrate rig``.
    places : sub-verbs, or choices of positional arguments.
    options : option -> its choices; empty for a value without choices (a file, mostly), None for a switch.
    helps : word -> what it is.
    """

    key: str
    places: list[str] = field(default_factory=list)
    options: dict[str, list[str] | None] = field(default_factory=dict)
    helps: dict[str, str] = field(default_factory=dict)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=SHELLS, help="the shell; in bash: source <(tracker_node completion bash)")


def run(args: argparse.Namespace) -> int:
    print(script(args.shell), end="")
    return 0


def script(shell: str) -> str:
    """The script of a shell of `SHELLS`, made from the parsers of all verbs."""
    words = list(all_words())
    return _fish_script(words) if shell == "fish" else _bash_script(words, in_zsh=shell == "zsh")


def all_words() -> Iterator[Words]:
    """Words of the program itself (key: empty), of every verb and every sub-verb."""
    import importlib

    from .main import module_of, parser_of, verbs

    modules = {verb: importlib.import_module(module_of(verb)) for verb in verbs()}
    summaries = {verb: module.SUMMARY for verb, module in modules.items()}
    yield Words("", list(modules), {"--help": None, "--version": None}, summaries)
    for verb, module in modules.items():
        yield from _words_of(verb, parser_of(verb, module))


def _words_of(key: str, parser: argparse.ArgumentParser) -> Iterator[Words]:
    words = Words(key)
    below: list[Words] = []
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            words.places += action.choices
            words.helps |= {chosen.dest: chosen.help or "" for chosen in action._choices_actions}
            for name, subparser in action.choices.items():
                below += _words_of(f"{key} {name}", subparser)
            continue
        choices = [str(choice) for choice in action.choices or ()]
        words.places += [] if action.option_strings else choices
        for option in action.option_strings:
            words.options[option] = None if action.nargs == 0 else choices
            words.helps[option] = (action.help or "").partition(";")[0]
    yield words
    yield from below


def _bash_script(words: list[Words], in_zsh: bool = False) -> str:
    """A function for bash 4 or newer; zsh runs the same by bashcompinit.

    Parameters
    ----------
    words : of `all_words`.
    in_zsh : for zsh.

    Returns
    -------
    Text to be sourced.
    """
    program, *others = words
    groups = "|".join(one.key for one in others if " " not in one.key and any(o.key.startswith(f"{one.key} ") for o in others))
    with_choices = [
        f"            {_quoted(f'{one.key} {option}')}) words={_quoted(' '.join(choices))} ;;"
        for one in others
        for option, choices in one.options.items()
        if choices
    ]
    with_values = [
        f"            {_quoted(f'{one.key} {option}')}) return ;;"
        for one in others
        for option, choices in one.options.items()
        if choices is not None and not choices
    ]
    options = [f"                    {_quoted(one.key)}) words={_quoted(' '.join(one.options))} ;;" for one in others]
    places = [f"                    {_quoted(one.key)}) words={_quoted(' '.join(one.places))} ;;" for one in others if one.places]
    lines = [
        *(["autoload -U +X compinit bashcompinit && compinit && bashcompinit"] if in_zsh else []),
        f"_{PROGRAM}() {{",
        '    local current="${COMP_WORDS[COMP_CWORD]}" previous="${COMP_WORDS[COMP_CWORD-1]}" key="${COMP_WORDS[1]}" words=""',
        "    COMPREPLY=()",
        "    if (( COMP_CWORD == 1 )); then",
        f"        words={_quoted(' '.join([*program.places, *program.options]))}",
        "    else",
        f'        case "$key" in {groups}) (( COMP_CWORD > 2 )) && key+=" ${{COMP_WORDS[2]}}" ;; esac',
        '        case "$key $previous" in',
        *with_choices,
        *with_values,
        '            *) case "$current" in',
        '                -*) case "$key" in',
        *options,
        "                esac ;;",
        '                *) case "$key" in',
        *places,
        "                esac ;;",
        "            esac ;;",
        "        esac",
        "    fi",
        '    COMPREPLY=($(compgen -W "$words" -- "$current"))',
        "}",
        f"complete -o default -o bashdefault -F _{PROGRAM} {PROGRAM}",
    ]
    return "\n".join(lines) + "\n"


def _fish_script(words: list[Words]) -> str:
    """A line for each word that fish may offer."""
    program, *others = words
    start = f"complete -c {PROGRAM} -n"
    lines = [f"{start} __fish_use_subcommand -f -a {_quoted(verb)} -d {_about(program, verb)}" for verb in program.places]
    for one in others:
        verb, _, what = one.key.partition(" ")
        condition = f"__fish_seen_subcommand_from {verb}"
        if what:
            condition += f"; and __fish_seen_subcommand_from {what}"
        lines += [f"{start} {_quoted(condition)} -a {_quoted(place)} -d {_about(one, place)}" for place in one.places]
        for option, choices in one.options.items():
            name = f"-l {option[2:]}" if option.startswith("--") else f"-s {option[1:]}"
            values = "" if choices is None else f" -x -a {_quoted(' '.join(choices))}" if choices else " -r"
            lines.append(f"{start} {_quoted(condition)} {name}{values} -d {_about(one, option)}")
    return "\n".join(lines) + "\n"


def _about(words: Words, word: str) -> str:
    return _quoted(" ".join(words.helps.get(word, "").replace("%%", "%").split()))


def _quoted(text: str) -> str:
    """For all three shells; a single quote in a help text becomes a typographic one."""
    return "'" + text.replace("'", "’").replace("\\", "/") + "'"
