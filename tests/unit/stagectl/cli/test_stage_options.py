"""Which machine files --machine and --simulate select."""

import click
from click.testing import CliRunner

from stagectl.cli.options import takes
from stagectl.cli.stage_options import StageCommand, StageOptions
from stagectl.config import load_machine


def test_simulate_without_a_file_simulates_the_hosts_machine(tmp_path):
    own = tmp_path / "coarse.yaml"
    text = load_machine(None).text
    own.write_text(text.replace("increment: 1.0e-9", "increment: 5.0e-9"))
    seen = []

    @click.command()
    @takes(StageOptions)
    def command(stage):
        seen.append(stage.load())

    for arguments in (["--simulate"], ["--simulate", "wafer-xy"], ["--bus", "socketcan:can0"]):
        done = CliRunner().invoke(command, ["--machine", str(own), *arguments])
        assert done.exit_code == 0, done.output
    (host, its_own), (_, packaged), (_, real) = seen
    assert its_own is host
    assert host.axes["x"].encoder.increment == 5e-9
    assert packaged.axes["x"].encoder.increment == 1e-9
    assert real is None


def test_a_recipe_that_simulate_has_swallowed_is_named():
    @click.command("run", cls=StageCommand)
    @click.argument("recipe")
    @takes(StageOptions)
    def command(stage, recipe):
        pass

    said = CliRunner().invoke(command, ["--simulate", "my recipe.yaml", "--seed", "2"])
    assert said.exit_code == 2
    assert "no RECIPE: --simulate has taken my recipe.yaml as TRUTH" in said.output
    assert "'run 'my recipe.yaml' --simulate'" in said.output
    for plain in (["--simulate"], ["--simulate", "--seed", "2"], []):
        assert "Missing argument 'RECIPE'" in CliRunner().invoke(command, plain).output
    assert CliRunner().invoke(command, ["r.yaml", "--simulate", "x.yaml"]).exit_code == 0
