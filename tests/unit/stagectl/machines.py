"""The packaged machine, changed."""

from stagectl.config import load_machine, parse_machine


def with_axes(machine, **changes):
    """The machine with these changes of its axes: of the axis itself, or of its drive."""
    axes = dict(machine.axes)
    for name, change in changes.items():
        axis = axes[name]
        drive = axis.drive.model_copy(update=change.get("drive", {}))
        axes[name] = axis.model_copy(update={**change, "drive": drive})
    return machine.model_copy(update={"axes": axes})


def with_effects(*effects, node=1, more=""):
    """The packaged machine with these effects on an axis, and `more` keys before them."""
    lines = "".join(f"      - {{{effect}}}\n" for effect in effects)
    before = f"    node: {node}\n"
    text = load_machine().text.replace(before, f"{before}{more}    effects:\n{lines}", 1)
    return parse_machine(text, "m.yaml")
