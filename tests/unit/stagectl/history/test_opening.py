"""Which history a run uses: by option, machine file and folder."""

from stagectl.config.machine.file import load_machine, parse_machine
from stagectl.history import default_history


def test_the_default_history_depends_on_option_machine_and_folder(tmp_path):
    plain = load_machine()
    text = plain.text + "history: fleet.db\n"
    named = parse_machine(text, str(tmp_path / "m.yaml"))
    run = tmp_path / "runs" / "a"
    beside, within = str(tmp_path / "runs" / "stage.db"), str(run / "stage.db")
    #        option, machine, simulated, folder named by the user
    cases = [
        ("h.db", named, False, False, "h.db"),
        ("h.db", named, True, True, "h.db"),
        ("none", named, False, False, None),
        (None, named, False, True, str(tmp_path / "fleet.db")),
        (None, named, True, False, beside),
        (None, plain, False, False, beside),
        (None, plain, False, True, within),
        (None, plain, True, True, None),
    ]
    for option, machine, simulated, own, where in cases:
        assert default_history(option, machine, simulated, run, own) == where
