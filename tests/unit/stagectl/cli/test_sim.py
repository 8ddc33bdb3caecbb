"""`stagectl sim --as FAMILY`: the list of families, and a name that is none."""

from click.testing import CliRunner

from stagectl.cli import cli
from stagectl.config.profiles import families
from stagectl.errors import ConfigError


def test_the_families_are_listed():
    done = CliRunner().invoke(cli, ["sim", "--as", "?"])
    assert done.exception is None
    assert all(family in done.output for family in families())


def test_an_unknown_family_is_refused_before_a_bus_is_opened():
    done = CliRunner().invoke(cli, ["sim", "--as", "epos", "--bus", "socketcan:nosuchcan9"])
    assert isinstance(done.exception, ConfigError)
    assert str(done.exception) == "no drive profile epos; did you mean 'epos4'?"
