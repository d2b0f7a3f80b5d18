"""From recordings at several temperatures to curves: one filter for all terms, then the choice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from triaxcal.base.progress import Progress
from triaxcal.dynamic.blocks.base import (
    ACCELEROMETER_BIAS,
    ACCELEROMETER_MATRIX,
    GYRO_BIAS,
    GYRO_MATRIX,
)
from triaxcal.dynamic.blocks.block import StateBlock
from triaxcal.dynamic.calibrate import DynamicResult, calibrate_dynamic
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.soak import Soak, soak_blocks, soak_information, split_soaks
from triaxcal.dynamic.survey import Section
from triaxcal.dynamic.temperatures import Recorded, recorded_temperatures
from triaxcal.dynamic.thermalbasis import GROUPS, OF_GYROS, Basis, block_over_temperature
from triaxcal.dynamic.thermalchoice import Choice, Curves, choose, folds_of
from triaxcal.dynamic.thermalcurves import Known, known_at, thermal_models
from triaxcal.dynamic.thermalnodes import Nodes, cut_at_nodes, gyro_nodes_of, nodes_of
from triaxcal.dynamic.thermalparts import (
    Information,
    constants_of,
    information_of,
    information_of_parts,
)
from triaxcal.model.curves import ThermalModel
from triaxcal.model.thermal.registry import AUTO, THERMAL_FUNCTIONS
from triaxcal.model.thermal.shape import EDGE_DEGC, ThermalShape
from triaxcal.model.types import FloatArray, IntArray
from triaxcal.unit.thermal import ThermalChoice

GRID = 17
"""Temperatures at which the uncertainty is stated."""


@dataclass(frozen=True)
class Temperatures:
    """What is known of the temperatures beforehand.

    Attributes
    ----------
    recorded : Recorded
    stated : ThermalChoice
        Of unit.toml.
    reference_degc : float
    where : str
        unit.toml, for messages.
    """

    recorded: Recorded
    stated: ThermalChoice
    reference_degc: float
    where: str


@dataclass(frozen=True)
class OverTemperature:
    """Both triads over the recorded temperatures.

    Attributes
    ----------
    nodes, gyro_nodes : Nodes
        The same where the gyros have no thermometer of their own.
    choice : Choice
    known : Known
        On a grid over the recorded range.
    accel, gyro : ThermalModel
        As in `ImuModel`.
    findings : tuple of str
        What was not seen over the whole range.
    """

    nodes: Nodes
    gyro_nodes: Nodes
    choice: Choice
    known: Known
    accel: ThermalModel
    gyro: ThermalModel
    findings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Solved:
    """A solution with all terms, and what was made of it.

    Attributes
    ----------
    full : DynamicResult
        All terms are states.
    shown : DynamicResult
        Constants at T0 by the chosen curves; the terms are left out.
    over : OverTemperature
    recording : ImuRecording
        What the filter used: the recordings in which the unit turns.
    functions : array, shape (n, parameters)
        The map from the parameters of the chosen functions to all constants and terms, in units
        of the priors.
    """

    full: DynamicResult
    shown: DynamicResult
    over: OverTemperature
    recording: ImuRecording
    functions: FloatArray = field(repr=False)


def solve_over_temperature(
    recording: ImuRecording,
    noise: DataSheet,
    blocks: tuple[StateBlock, ...],
    at: Temperatures,
    report: Progress,
) -> Solved:
    """Constants over temperature of one or several recordings.

    Raises
    ------
    RefusedError
        As `calibrate_dynamic`; when the recorded temperatures do not determine the function that
        unit.toml states.
    """
    recorded = at.recorded
    nodes = nodes_of(recorded, at.reference_degc)
    gyro_nodes = gyro_nodes_of(recorded, nodes, at.reference_degc)
    turning, soaks = split_soaks(recording)
    moved = recorded if turning is recording else recorded_temperatures(turning)
    assert moved is not None
    seen = _seen(nodes, gyro_nodes, moved)
    shapes = {name: shapes_of(at.stated, own, at.where) for name, own in seen.items()}
    bases = _bases(seen, shapes, recorded, (nodes.t0_degc, gyro_nodes.t0_degc))
    terms = tuple(
        block_over_temperature(block, bases[block.name], nodes.t0_degc)
        for block in GROUPS
        if bases[block.name].terms
    )
    full = calibrate_dynamic(
        turning,
        noise,
        (*blocks, *terms),
        reference_degc=nodes.t0_degc,
        progress=lambda number, part: report(f"pass {number + 1}", part),
    )
    everything, by_node, layout = _information(turning, full, (moved, nodes), soaks, report)
    free = tuple(name for name, own in seen.items() if len(own.degc) < len(nodes.degc))
    curves = Curves(layout, bases, {name: own.degc for name, own in seen.items()}, free)
    choice = choose(curves, everything, folds_of(nodes, gyro_nodes, by_node), shapes)
    grids = (np.linspace(*ends, GRID) for ends in (recorded.ends_degc, recorded.gyro_ends_degc))
    known = known_at(curves, everything, choice, *grids)
    models = thermal_models(choice.fit, nodes.t0_degc, gyro_nodes.t0_degc)
    over = OverTemperature(nodes, gyro_nodes, choice, known, *models, _findings(recorded, moved))
    own = Curves(constants_of(full), bases, curves.seen).map_of(choice.fit.shapes)[0]
    return Solved(full, _shown(full, curves, choice), over, turning, own)


def _seen(nodes: Nodes, gyro_nodes: Nodes, moved: Recorded) -> dict[str, Nodes]:
    """Temperatures at which each group was seen: a matrix only where the unit turned."""
    turned = sorted({int(k) for k in nodes.nearest(moved.degc)})
    return {
        ACCELEROMETER_BIAS.name: nodes,
        ACCELEROMETER_MATRIX.name: _part(nodes, turned),
        GYRO_BIAS.name: gyro_nodes,
        GYRO_MATRIX.name: _part(gyro_nodes, turned),
    }


def _part(nodes: Nodes, numbers: list[int]) -> Nodes:
    """Some of the nodes; T0 is that of all, or the nearest of them."""
    degc = nodes.degc[numbers]
    return Nodes(degc, float(degc[int(np.argmin(np.abs(degc - nodes.t0_degc)))]))


def _bases(
    seen: Mapping[str, Nodes],
    shapes: Mapping[str, Sequence[ThermalShape]],
    recorded: Recorded,
    t0_degc: tuple[float, float],
) -> dict[str, Basis]:
    """Functions of each group: those of a triad span what its own groups may follow."""
    bases: dict[str, Basis] = {}
    for names, t0, degc in zip(
        ((ACCELEROMETER_BIAS.name, ACCELEROMETER_MATRIX.name), OF_GYROS),
        t0_degc,
        (recorded.degc, recorded.gyro_degc),
        strict=True,
    ):
        spanned = dict.fromkeys(s for n in names for s in with_folds(tuple(shapes[n]), seen[n]))
        bases |= dict.fromkeys(names, Basis.spanning(tuple(spanned), t0, degc))
    return bases


def _findings(recorded: Recorded, moved: Recorded) -> tuple[str, ...]:
    """What was not seen over the whole range."""
    (low, high), (first, last) = recorded.ends_degc, moved.ends_degc
    if first - EDGE_DEGC <= low and high <= last + EDGE_DEGC:
        return ()
    turned = f"the unit turned at {first:.1f} to {last:.1f} degC only"
    beyond = f"scale factors and misalignments at {low:.1f} to {high:.1f} degC"
    return (f"{turned}: it is not shown that {beyond} follow the same functions",)


def _information(
    turning: ImuRecording,
    full: DynamicResult,
    at: tuple[Recorded, Nodes],
    soaks: tuple[Soak, ...],
    report: Progress,
) -> tuple[Information, dict[int, Information], Layout]:
    """What everything says, what each node says, and the layout of both."""
    moved, nodes = at
    cut, node_of = cut_at_nodes(full.survey, moved, nodes)
    present = sorted({int(k) for k in node_of})
    parts = tuple(_sections(cut.sections, node_of, k) for k in present)
    by_part = information_of_parts(
        turning, full, parts, lambda part: report("temperatures held out", part)
    )
    own = soak_blocks(soaks)
    layout = Layout((*constants_of(full).blocks, *own))
    size = len(layout)
    by_node = {k: found.padded(size) for k, found in zip(present, by_part, strict=True)}
    total = information_of(full).padded(size)
    for soak, block in zip(soaks, own, strict=True):
        for node, found in soak_information(soak, block, layout, full, nodes).items():
            total = total + found
            by_node[node] = by_node[node] + found if node in by_node else found
    return total, dict(sorted(by_node.items())), layout


def shapes_of(stated: ThermalChoice, nodes: Nodes, where: str) -> tuple[ThermalShape, ...]:
    """Functions to choose from.

    Raises
    ------
    RefusedError
        When the nodes do not determine one that is stated.
    """
    if stated.model == AUTO:
        found = [s for f in THERMAL_FUNCTIONS for s in f.candidates(nodes.degc, nodes.t0_degc)]
        return tuple(found)
    function = THERMAL_FUNCTIONS[stated.model]
    shapes = function.stated(stated.settings, nodes.degc, nodes.t0_degc)
    for shape in shapes:
        if error := shape.undetermined(where, nodes.degc):
            raise error
    return shapes


def with_folds(shapes: tuple[ThermalShape, ...], nodes: Nodes) -> tuple[ThermalShape, ...]:
    """The shapes, and what is left of them where a temperature is held out."""
    fewer = [
        shape.without(np.delete(nodes.degc, k), float(nodes.degc[k]))
        for shape in shapes
        for k in range(1, len(nodes.degc) - 1)
    ]
    return tuple(dict.fromkeys((*shapes, *fewer)))


def _sections(sections: tuple[Section, ...], node_of: IntArray, node: int) -> tuple[Section, ...]:
    return tuple(s for s, k in zip(sections, node_of, strict=True) if k == node)


def _shown(full: DynamicResult, curves: Curves, choice: Choice) -> DynamicResult:
    """The result without terms: constants at T0 as the chosen curves have them there."""
    layout = full.layout
    keep = np.concatenate([np.arange(len(layout))[layout.place(b.name)] for b in layout.blocks
                           if b.shown])  # fmt: skip
    shown = Layout(tuple(b for b in layout.blocks if b.shown))
    p, covariance = full.p.copy(), full.covariance.copy()
    M, _ = curves.map_of(choice.fit.shapes)
    sd = curves.layout.prior_sd
    n = len(constants_of(full))
    p[:n] = ((M @ choice.fit.q) * sd)[:n]
    covariance[:n, :n] = (M @ choice.fit.covariance @ M.T * np.outer(sd, sd))[:n, :n]
    last = full.passes[-1]
    history = replace(
        last.history,
        p=[row[keep] for row in last.history.p],
        sd=[row[keep] for row in last.history.sd],
    )
    return replace(
        full,
        layout=shown,
        p=p[keep],
        sd=np.sqrt(np.diag(covariance))[keep],
        covariance=covariance[np.ix_(keep, keep)],
        passes=(*full.passes[:-1], replace(last, history=history)),
    )
