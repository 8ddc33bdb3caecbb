"""What a fleet says, for terminal and page; its tables for other programs."""

from __future__ import annotations

from collections.abc import Sequence

import pyarrow as pa

from stagectl.fleet.patterns import Drift
from stagectl.fleet.rows import FRICTION, RESULT, Row, to_parquet
from stagectl.fleet.stages import COULOMB, GAP, Series, StageState
from stagectl.fleet.storage import Folder
from stagectl.fleet.summary import Summary
from stagectl.report import Fact, Outline, Section, Table, render_page
from stagectl.report.chart import Chart, Curve
from stagectl.report.formats import DASH, date, digits, percent
from stagectl.report.outline import Level

PAGE = "summary.html"
_UNITS = {COULOMB: "N", GAP: "floors"}
_LEVELS: dict[str, Level] = {
    "no_gap": "good", "explained": "good", "partly_explained": "warning", "unexplained": "bad",
    "insufficient": "warning",
}  # fmt: skip
_MOST_STAGES = 20
_MOST_CHARTS = 12
_MOST_KEYS = 3
_LISTS = ("channels", "gap", "causes", "friction", "machine", "report")
_OF_A_RESULT = ("recording", "stage", "simulated", "started", "recipe", "lot")
CAUSE = pa.schema(
    [*(RESULT.field(name) for name in _OF_A_RESULT), *RESULT.field("causes").type.value_type]
)
DIAGNOSIS = pa.schema([field for field in RESULT if field.name not in _LISTS])


def fleet_outline(summary: Summary) -> Outline:
    """All that a summary says."""
    lost = len(summary.refused) + len(summary.failures)
    badges = [Fact(f"Stages: {len(summary.stages)}")]
    if lost:
        badges.append(Fact(f"{lost} recordings without a diagnosis", "warning"))
    return Outline(
        "Fleet",
        "",
        badges,
        _headline(summary),
        sections={
            "stages": _stages(summary.stages),
            "due": Section(
                "Due",
                [
                    Fact(f"{of.stage}: {of.why}. {of.what}{_within(of.within)}", "warning")
                    for of in summary.due
                ],
                most=_MOST_STAGES,
            ),
            "effects": _effects(summary.stages),
            "common": _common(summary),
            "drifts": _drifts(summary.drifts),
            "lost": Section(
                "Recordings without a diagnosis",
                [Fact(f"{name}: {why}", "warning") for name, why in summary.refused.items()]
                + [Fact(f"{name}: {why}", "bad") for name, why in summary.failures.items()],
            ),
        },
    )


def _headline(summary: Summary) -> str:
    diagnosed = summary.recordings - len(summary.refused)
    worst = next((s for s in summary.stages if s.effects), None)
    text = f"{diagnosed} recordings diagnosed."
    if worst is not None and worst.floors is not None:
        effect = worst.effects[0].effect.replace("_", " ")
        text += f" Largest gap with a named cause: {worst.key}, {worst.floors:.1f} floors, {effect}"
        text += f" on {worst.effects[0].axis}."
    return text


def _within(days: float) -> str:
    return f" Within {days:.0f} days." if days >= 1.0 else ""


def _stages(stages: Sequence[StageState]) -> Section:
    rows = [
        (
            str(of.key),
            digits(of.floors),
            Fact(of.verdict.replace("_", " "), _LEVELS[of.verdict]),
            ", ".join(
                f"{e.effect.replace('_', ' ')} on {e.axis} ({percent(e.gap_closed)})"
                for e in of.effects
            ) or DASH,
            str(of.recordings),
            DASH if of.last is None else date(of.last.isoformat()),
        )
        for of in stages[:_MOST_STAGES]
    ]  # fmt: skip
    more = len(stages) - len(rows)
    titles = ("Stage", "Gap / floor", "Verdict", "Effects", "Recordings", "Last")
    note = (
        "Median gap of each stage's last recordings, in floors; effects that most of them name, "
        "with the share of the gap that each closes."
    )
    facts = [Fact(f"and {more} stages with a smaller gap")] if more else []
    table = Table(titles, rows, on_page=("Recordings", "Last"))
    return Section("Stages, the worst first", facts, table, note=note)


def _effects(stages: Sequence[StageState]) -> Section:
    """Which effects occur in how many stages."""
    names = [e.effect for of in stages for e in {e.effect: e for e in of.effects}.values()]
    ranked = sorted(set(names), key=lambda name: (-names.count(name), name))
    facts = [
        Fact(
            f"{name.replace('_', ' ')}: {names.count(name)} of {len(stages)} stages",
            share=names.count(name) / len(stages),
        )
        for name in ranked
    ]
    return Section("Effects", facts)


def _common(summary: Summary) -> Section:
    facts = []
    for of in summary.common:
        pairs = [f"{key} = {value}" for key, value in zip(of.keys, of.values, strict=True)]
        keys = ", ".join(pairs[:_MOST_KEYS]) + (", ..." if len(pairs) > _MOST_KEYS else "")
        facts.append(
            Fact(
                f"{of.effect.replace('_', ' ')}: {of.of_those[0]} of {of.of_those[1]} stages with "
                f"it have {keys}, {of.of_others[0]} of {of.of_others[1]} without it"
            )
        )
    note = (
        "Keys of machine files and runs that stages with an effect share more often than chance "
        "gives. It is no proof of a cause."
    )
    return Section("In common", facts, note=note)


def _drifts(drifts: Sequence[Drift]) -> Section:
    rows = [
        (
            str(of.series.key), of.series.axis or DASH, of.series.figure,
            percent(of.change, 1, signed=True), f"{of.days:.0f}",
            f"{of.per_day:+.2g} ({of.interval[0]:+.2g} to {of.interval[1]:+.2g}) "
            f"{_UNITS[of.series.figure]}",
        )
        for of in drifts[:_MOST_STAGES]
    ]  # fmt: skip
    titles = ("Stage", "Axis", "Figure", "Change", "Days", "Per day (95 %)")
    note = (
        "Slopes of the medians of days (Theil and Sen), where their order is no chance (Kendall)."
    )
    return Section("Drifts", (), Table(titles, rows), note=note)


def render_fleet(summary: Summary) -> str:
    """The page's HTML."""
    drifting = [of.series for of in summary.drifts]
    worst = {of.key: rank for rank, of in enumerate(summary.stages)}
    gaps = [of for of in summary.series if of.figure == GAP and len(of.time) > 1]
    gaps.sort(key=lambda of: worst.get(of.key, len(worst)))
    return render_page(
        "fleet.html.j2",
        fleet_outline(summary),
        drifts=[(_title(of), _chart(of)) for of in drifting[:_MOST_CHARTS]],
        gaps=[(_title(of), _chart(of)) for of in gaps[:_MOST_CHARTS]],
    )


def _title(series: Series) -> str:
    axis = f", axis {series.axis}" if series.axis else ""
    return f"{series.key}{axis}: {series.figure}"


def _chart(series: Series) -> Chart:
    curve = Curve("measured", series.time, series.value, has_line=False)
    return Chart([curve], "", _UNITS[series.figure], is_time=True)


def write_summary(
    folder: Folder, summary: Summary, rows: Sequence[Row], friction: Sequence[Row]
) -> list[str]:
    """Write page and tables beside the results; returns their names.

    Raises:
        StagectlError: one cannot be written.
    """
    own = [
        {**{name: row[name] for name in _OF_A_RESULT}, **of}
        for row in rows for of in row["causes"]
    ]  # fmt: skip
    measured = [
        {**{name: row[name] for name in ("stage", "simulated", "started")}, **of,
         "source": row["recording"]}
        for row in rows for of in row["friction"]
    ]  # fmt: skip
    files: dict[str, bytes | str] = {
        PAGE: render_fleet(summary),
        "diagnoses.parquet": to_parquet(rows, DIAGNOSIS),
        "causes.parquet": to_parquet(own, CAUSE),
        "friction.parquet": to_parquet([*measured, *friction], FRICTION),
    }
    for name, content in files.items():
        folder.write(name, content)
    return list(files)
