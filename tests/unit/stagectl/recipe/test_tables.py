"""Tables of sites and offsets: what is read, and that every problem has its place."""

import pytest

from stagectl.errors import ConfigError
from stagectl.recipe import load_recipe
from stagectl.recipe.model import ListedMarks
from tests.unit.stagectl.recipe.conftest import HEAD


def test_sites_and_offsets_from_files(tmp_path, machine, problems_of):
    path = tmp_path / "r.yaml"
    fiducial = "fiducial: {source: offsets, file: o.csv}\n"
    path.write_text(f"{HEAD}expose: 0\nsites: {{file: s.csv}}\n{fiducial}")
    sites, offsets = tmp_path / "s.csv", tmp_path / "o.csv"
    sites.write_text("# mm\ny, x\n1 mm, 2e-3\n-0.1, 150 mm\n")
    offsets.write_text("site,dx,dy\n2,-5 um,1e-6\n")
    recipe = load_recipe(path, machine)
    assert recipe.sites == ((2e-3, 1e-3), (0.15, -0.1))
    assert recipe.fiducial == ListedMarks({2: (-5e-6, 1e-6)})

    offsets.write_text("site,dx,dy\n2,5 um,0\n3,0,0\n")
    with pytest.raises(ConfigError) as caught:
        load_recipe(path, machine)
    assert caught.value.problems == (
        f"{offsets}:3:1: site 3 is not in the recipe, which has 2",
        f"{sites}:4:1: site 2: 0.15 m with its fiducial 5e-06 m away is outside the travel "
        "-0.15 ... 0.15 m of axis x",
    )

    offsets.unlink()
    sites.write_text("x,y\n1,2,3\n nan,5 ms\n")
    with pytest.raises(ConfigError) as caught:
        load_recipe(path, machine)
    assert [line.removeprefix(str(tmp_path)) for line in caught.value.problems] == [
        "/s.csv:2:1: must have 2 cells, has 3",
        "/s.csv:3:2: x: must be a finite number, is nan",
        "/s.csv:3:6: y: must be a length (SI, or a text such as '80 um'), but '5 ms' is a time",
        f"/r.yaml:7:35: fiducial.file: {offsets}: no such file",
    ]


@pytest.mark.parametrize(
    ("table", "reason"),
    [
        ("", ":1:1: is empty: a header line x,y is expected"),
        ("x\n1\n", ":1:1: y: is missing"),
        ("x,y,z\n1,2,3\n", ":1:1: z: unknown column; known: x, y, site"),
        ("x,x,y\n1,2,3\n", ":1:1: x: duplicate column"),
        ("x,y\n", ":1:1: must have 1 to 100000 rows below the header, has 0"),
        ("site,x,y\n2,0,0\n", ":2:1: site must be 1, is 2: sites count from 1 without a gap"),
        ("site,x,y\none,0,0\n", ":2:1: site: must be a site number from 1, is 'one'"),
        ("x,y\n,0\n", ":2:1: x: must be a length, is ''"),
    ],
)
def test_faults_of_a_table(tmp_path, problems_of, table, reason):
    (tmp_path / "s.csv").write_text(table)
    text = HEAD + "expose: 0\nsites: {file: s.csv}\nfiducial: {source: none}\n"
    (found,) = problems_of(text, str(tmp_path / "r.yaml"))
    assert found == f"{tmp_path}/s.csv{reason}"


def test_a_table_that_is_a_directory_is_placed_where_the_recipe_names_it(tmp_path, problems_of):
    (tmp_path / "sites2").mkdir()
    text = HEAD + "expose: 0\nsites: {file: sites2}\nfiducial: {source: none}\n"
    (found,) = problems_of(text, str(tmp_path / "r.yaml"))
    assert found == (
        f"{tmp_path}/r.yaml:6:15: sites.file: {tmp_path}/sites2: is a directory, not a file"
    )
