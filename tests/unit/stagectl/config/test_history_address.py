"""Passwords in the address of a history: in no message and no recording."""

from pathlib import Path

import pytest

from stagectl.config import is_server, without_password
from stagectl.config.history_address import shown_address
from stagectl.errors import StagectlError
from stagectl.history import open_history

psycopg = pytest.importorskip("psycopg")


@pytest.mark.parametrize(
    "where",
    [
        "postgresql://u:open sesame@localhost:1/db",
        "postgresql://u:open%20sesame@localhost:1/db",
        "postgresql://u:open/sesame@localhost:1/db",
        "postgresql://u:12/sesame@localhost:1/db",
        "postgresql://u:open@sesame@localhost:1/db",
        "postgresql://u:open?sesame@localhost:1/db",
        "postgresql://localhost:1/db?password=open sesame",
        "host=localhost port=1 user=u password='open sesame' dbname=db",
        "host=localhost port=1 user=u password = 'open sesame' dbname=db",
        "host=localhost port=1 user=u password='open sesame dbname=db",
        "host=localhost port=1 user=u password=open sesame dbname=db",
        "password='open sesame' hast=localhost",
        "mysql://u:open sesame@localhost/db",
        "POSTGRESQL://u:open sesame@localhost/db",
    ],
)
@pytest.mark.parametrize("write", [True, False])
def test_no_form_of_an_address_shows_its_password(where, write):
    with pytest.raises(StagectlError) as caught:
        open_history(where, write)
    text = str(caught.value)
    assert "\n" not in text
    assert "open" not in text.replace("open_", "")
    assert "sesame" not in text


@pytest.mark.parametrize(
    ("where", "shown"),
    [
        ("runs/stage.db", "runs/stage.db"),
        ("postgresql://u:secret@h:5433/db", "postgresql://h:5433/db"),
        ("postgresql:///db?host=/tmp/x", "postgresql:///tmp/x/db"),
        ("host=h dbname=db user=u password='a b'", "postgresql://h/db"),
        ("host='", "PostgreSQL"),
    ],
)
def test_messages_name_the_server_and_nothing_else(where, shown):
    assert shown_address(where) == shown


@pytest.mark.parametrize(
    ("where", "named"),
    [
        ("postgresql://u:s3cret@host:5433/db", "postgresql://u@host:5433/db"),
        ("postgresql://u:s3?cret@h/db?sslmode=require", "postgresql://u@h/db?sslmode=require"),
        ("postgres://h/db?user=u&password=s3cret", "postgres://h/db?user=u"),
        ("postgresql://h/db?pass%77ord=s3cret", "postgresql://h/db"),
        ("postgresql:///db?host=/tmp/x", "postgresql:///db?host=/tmp/x"),
        ("postgresql://stage@/db", "postgresql://stage@/db"),
        ("runs/stage.db", str(Path("runs/stage.db").absolute())),
    ],
)
def test_a_recording_names_its_history_without_password(where, named):
    assert without_password(where) == named


def test_key_value_pairs_are_recorded_without_passwords():
    where = r"host=h dbname='my db' user=u password='it\'s' sslpassword=x"
    assert is_server(where)
    kept = psycopg.conninfo.conninfo_to_dict(without_password(where))
    assert kept == {"host": "h", "dbname": "my db", "user": "u"}


@pytest.mark.parametrize("where", ["stage.db", "runs/host=1.db", "/var/my password/stage.db"])
def test_a_path_is_a_path(where):
    assert not is_server(where)
