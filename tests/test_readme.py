"""README.md says what the code does."""

from __future__ import annotations

import re
from pathlib import Path

import click

from gcvec.cli._app import root
from worker.settings import Settings, listing

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


def test_settings_table_is_the_settings_class() -> None:
    rows = re.findall(r"^\| `GCVEC_(\w+)` \| (?:`(.*)`)? *\| (.+) \|$", README, re.MULTILINE)
    assert [name.lower() for name, _, _ in rows] == list(Settings.model_fields)
    for name, shown, meaning in rows:
        field = Settings.model_fields[name.lower()]
        assert meaning == field.description
        default = Settings.model_validate({name.lower(): shown}) if shown else Settings()
        assert getattr(default, name.lower()) == field.default, name
        assert shown or not field.default, name


def test_every_command_is_in_the_table() -> None:
    commands = root.list_commands(click.Context(root))
    assert sorted(re.findall(r"^\| `gcvec (\w+)", README, re.MULTILINE)) == sorted(commands)


def test_pictures_exist_and_are_small() -> None:
    pictures = [ROOT / path for path in re.findall(r"!\[.*?\]\((.*?)\)", README)]
    assert len(pictures) == 4
    assert max(path.stat().st_size for path in pictures) < 200_000


def test_serve_lists_the_same_settings() -> None:
    lines = [line.partition(": ")[::2] for line in listing().splitlines()]
    table = re.findall(r"^\| `(GCVEC_\w+)` \| (?:`(.*)`)? *\| (.+) \|$", README, re.MULTILINE)
    assert lines == [(f"{name} ({shown or 'empty'})", meaning) for name, shown, meaning in table]
