"""Each JSON object on stdout follows the schema that it names."""

import json
import math
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
import typer

import fricjax as fj
from fricjax.cli.main import SCHEMAS, app
from tests.cli.conftest import call
from tests.laboratory import RIG, write_files, write_table

DOCUMENTS = {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in sorted(SCHEMAS.glob("*.json"))}
WITH_RIG = "--rig rig.toml"
# Commands in their order, each with the name of its schema and its exit code.
COMMANDS = {
    f"fit run.csv {WITH_RIG} --out fit.json": ("fit", 0),
    f"fit run.csv {WITH_RIG} --bounds damping=0.2:0.3 --out bound.json": ("fit", 3),
    "fit no-such-run.csv": ("error", 4),
    "demo": ("fit", 0),
    "inspect run.csv": ("inspect", 0),
    "inspect sheet.csv --run all": ("inspect", 0),
    f"check {WITH_RIG} --x0 1mm --free mu=0.05,mu_s=0.06,normal_force --rate 5k --duration 0.3": ("check", 3),
    f"compare run.csv {WITH_RIG} --friction coulomb --no-held-out": ("compare", 0),
    f"map run1.csv run2.csv run3.csv {WITH_RIG}": ("map", 0),
    f"energy run.csv {WITH_RIG} --out energy.json": ("energy", 0),
    "budget fit.json --draws 100000": ("budget", 0),
    f"simulate {WITH_RIG} --x0 2mm --fix mu=0.05 --duration 0.1": ("simulate", 0),
    "report fit.json": ("report", 0),
    "calibrate ringdown free.csv": ("ringdown", 0),
    "calibrate frf receptance.csv": ("frf", 0),
    "calibrate interferometer": ("interferometer", 0),
    f"batch runs {WITH_RIG} --out results --dry-run": ("plan", 0),
    f"batch runs {WITH_RIG} --out results": ("status", 1),
    "status results": ("status", 0),
    "query 'select file, mu from runs' results": ("query", 0),
    "doctor": ("doctor", 0),
    "models": ("models", 0),
    "models show lugre": ("law", 0),
}
LIGHT = ("inspect", "models", "calibrate interferometer", "fit no-such")
FILES = {"fit.json": "fit", "bound.json": "fit", "energy.json": "energy"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Write the files that the commands name."""
    folder = tmp_path_factory.mktemp("json")
    write_files(folder)
    (folder / "runs" / "broken.csv").write_text("t,x\n1,a\n")
    (folder / "rig.toml").write_text(RIG)
    frequency = 10 + np.arange(401) / 80
    omega = 2 * np.pi * frequency
    receptance = 1 / (2574.0 - 0.41068 * omega**2 + 0.1756j * omega)
    parts = {"Re [m/N]": receptance.real, "Im [m/N]": receptance.imag}
    write_table(folder / "receptance.csv", **{"Frequency [Hz]": frequency, **parts})
    return folder


@pytest.fixture(scope="module")
def printed(folder) -> dict[str, dict[str, Any]]:
    """Return the object that each command prints."""
    found = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for command, (_, code) in COMMANDS.items():
            called = call(*shlex.split(command), "--json")
            assert called.code == code, (command, called)
            found[command] = json.loads(called.out, parse_constant=pytest.fail)
    return found


def strict(schema: Any) -> Any:
    """Return a schema that refuses keys without a description."""
    if isinstance(schema, list):
        return [strict(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    closed = {name: strict(value) for name, value in schema.items()}
    return {"additionalProperties": False, **closed} if isinstance(schema.get("properties"), dict) else closed


def validate(content: Any, name: str) -> None:
    """Validate an object, and refuse undocumented keys."""
    jsonschema.Draft202012Validator(strict(DOCUMENTS[name])).validate(content)


@pytest.mark.parametrize("command", [command for command in COMMANDS if command.startswith(LIGHT)])
def test_a_light_command_prints_an_object_of_its_schema(folder, monkeypatch, command):
    monkeypatch.chdir(folder)
    name, _ = COMMANDS[command]
    validate(json.loads(call(*shlex.split(command), "--json").out), name)


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_prints_an_object_of_its_schema(printed, command):
    name, _ = COMMANDS[command]
    validate(printed[command], name)


@pytest.mark.slow
@pytest.mark.parametrize("file", FILES)
def test_a_file_follows_its_schema(printed, folder, file):
    content = json.loads((folder / file).read_text(encoding="utf-8"), parse_constant=pytest.fail)
    validate(content, FILES[file])


@pytest.mark.slow
def test_infinity_is_null_on_stdout_and_a_text_in_a_file(printed, folder):
    command = next(command for command in COMMANDS if "bound.json" in command)
    assert printed[command]["std_errors"]["damping"] is None
    stored = json.loads((folder / "bound.json").read_text(encoding="utf-8"))
    assert stored["std_errors"]["damping"] == "inf"
    assert math.isinf(fj.load_fit(folder / "bound.json").std_errors["damping"])


@pytest.mark.slow
@pytest.mark.usefixtures("printed")
def test_a_text_that_reads_inf_stays(folder, monkeypatch):
    monkeypatch.chdir(folder)
    assert json.loads(call("query", "select 'inf' as word", "results", "--json").out)["rows"] == [["inf"]]


@pytest.mark.slow
def test_an_undescribed_key_is_refused(printed):
    content = next(iter(printed.values()))
    with pytest.raises(jsonschema.ValidationError, match="'surprise' was unexpected"):
        validate({**content, "surprise": 1}, "fit")


def test_every_command_and_every_schema_is_tried_above():
    assert {name for name, _ in COMMANDS.values()} == set(DOCUMENTS)
    tried = {command for command in COMMANDS if not command.startswith("fit no-such")}
    for command in leaves(typer.main.get_command(app)):
        assert any(f"{words} ".startswith(f"{command} ") for words in tried), command


def leaves(group: Any, before: str = "") -> Iterator[str]:
    """Yield the words of each command."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from leaves(command, f"{before}{name} ")
        else:
            yield before + name


def subschemas(schema: Any) -> Iterator[dict[str, Any]]:
    """Yield all objects within a schema."""
    for each in schema.values() if isinstance(schema, dict) else schema:
        if isinstance(each, dict | list):
            yield from subschemas(each)
    if isinstance(schema, dict):
        yield schema


@pytest.mark.parametrize("name", DOCUMENTS)
def test_a_schema_is_valid_printed_and_described(name):
    document = DOCUMENTS[name]
    jsonschema.Draft202012Validator.check_schema(document)
    assert document["properties"]["schema"]["const"].split("/")[0] == f"fricjax.{name}"
    assert json.loads(call("--schema", name).out) == document
    described = [
        (key, value["description"])
        for part in subschemas(document)
        if isinstance(part.get("properties"), dict)
        for key, value in part["properties"].items()
    ]
    assert all(text.endswith(".") for _, text in described), described


def test_an_unknown_schema_is_refused():
    called = call("--schema", "fitt")
    assert called.code == 2
    assert "There is no schema 'fitt'. Did you mean 'fit'? Choose one of budget, check," in called.err
