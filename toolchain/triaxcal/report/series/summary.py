"""The terminal's summary of a series."""

from __future__ import annotations

from triaxcal.batch.run import Series
from triaxcal.batch.statistics import alike, outliers, quantities, runs
from triaxcal.report.series.results import results


def series_summary(series: Series, kept: int, seconds: float, workers: int, where: str) -> str:
    """Yield, rate, outliers, drift and where the page is."""
    records = series.records
    total = len(records) + len(series.refused)
    verdicts = [f"{count} {result}" for result, count in results(series)]
    lines = [f"{'series':<16}{total} units: {', '.join(verdicts)}"]
    made = f"{series.made} units"
    if series.made:
        rate = 60.0 * series.made / seconds
        made += f" in {_duration(seconds)}: {rate:.3g} a minute, {rate / workers:.3g} a worker"
    if kept:
        made += f"; {kept} were done and unchanged"
    lines.append(f"{'made':<16}{made}")
    far = [o for group in alike(records) for o in outliers(group, quantities(group))]
    names = list(dict.fromkeys(o.unit for o in far))
    if names:
        lines.append(f"{'outliers':<16}{', '.join(names)}")
    drifted = [r for group in alike(records) for r in runs(group) if r.told]
    if drifted:
        worst = max(drifted, key=lambda r: r.z)
        lines.append(
            f"{'drift':<16}{len(drifted)} run(s) differ significantly from the run before on the "
            f"same rig; the largest: {worst.rig} {worst.date}, {worst.worst} by "
            f"{worst.shift:+.3g} {worst.of_unit.replace('µ', 'micro-')}"
        )
    lines.append(f"{'page':<16}{where}")
    return "\n".join(lines)


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{seconds:.1f} s"
