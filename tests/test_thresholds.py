"""The numbers that the method was given are listed, each with a reason."""

import json

import pytest

from forceid.cli.app import main
from forceid.cli.boundary.thresholds import chosen_numbers
from forceid.config import load_settings


@pytest.fixture(scope="module")
def numbers():
    return chosen_numbers()


def test_every_chosen_number_says_what_it_is(numbers):
    assert len(numbers) > 100
    assert [f"{n.module}.{n.name}" for n in numbers if not n.reason] == []


def test_they_are_printed_by_room_or_as_one_object(numbers, capsys):
    assert main(["settings", "--thresholds"]) == 0
    text = capsys.readouterr().out
    assert all(f"{n.name} = {n.value}" in text for n in numbers)
    assert main(["settings", "--thresholds", "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["numbers"]) == len(numbers)


def test_the_settings_that_are_printed_are_the_default_ones(tmp_path, capsys):
    assert main(["settings"]) == 0
    path = tmp_path / "printed.toml"
    path.write_text(capsys.readouterr().out)
    assert load_settings(path) == load_settings()


def test_a_name_stands_for_one_number(numbers):
    values = {}
    for number in numbers:
        values.setdefault(number.name, set()).add(number.value)
    assert {name: found for name, found in values.items() if len(found) > 1} == {}
