"""From recordings at several temperatures to curves: one filter for all terms, then the choice."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from triaxcal.base.progress import Progress
from triaxcal.dynamic.blocks.block import StateBlock
from triaxcal.dynamic.calibrate import DynamicResult, calibrate_dynamic
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.survey import Section
from triaxcal.dynamic.temperatures import Recorded
from triaxcal.dynamic.thermalbasis import GROUPS, Basis, block_over_temperature
from triaxcal.dynamic.thermalchoice import Choice, Curves, choose, folds_of
from triaxcal.dynamic.thermalcurves import Known, known_at, thermal_models
from triaxcal.dynamic.thermalnodes import Nodes, cut_at_nodes, nodes_of
from triaxcal.dynamic.thermalparts import (
    constants_of,
    information_of,
    information_of_parts,
)
from triaxcal.model.curves import ThermalModel
from triaxcal.model.thermal.registry import AUTO, THERMAL_FUNCTIONS
from triaxcal.model.thermal.shape import ThermalShape
from triaxcal.model.types import IntArray
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
    nodes : Nodes
    choice : Choice
    known : Known
        On a grid over the recorded range.
    accel, gyro : ThermalModel
        As in `ImuModel`.
    """

    nodes: Nodes
    choice: Choice
    known: Known
    accel: ThermalModel
    gyro: ThermalModel


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
    """

    full: DynamicResult
    shown: DynamicResult
    over: OverTemperature


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
    shapes = shapes_of(at.stated, nodes, at.where)
    basis = Basis.spanning(_with_folds(shapes, nodes), nodes.t0_degc, recorded.degc)
    terms = tuple(block_over_temperature(block, basis) for block in GROUPS) if basis.terms else ()
    full = calibrate_dynamic(
        recording,
        noise,
        (*blocks, *terms),
        reference_degc=nodes.t0_degc,
        progress=lambda number, part: report(f"pass {number + 1}", part),
    )
    cut, node_of = cut_at_nodes(full.survey, recorded, nodes)
    present = sorted({int(k) for k in node_of})
    parts = tuple(_sections(cut.sections, node_of, k) for k in present)
    by_part = information_of_parts(
        recording, full, parts, lambda part: report("temperatures held out", part)
    )
    by_node = dict(zip(present, by_part, strict=True))
    curves = Curves(constants_of(full), basis)
    everything = information_of(full)
    choice = choose(curves, everything, folds_of(nodes, by_node), shapes)
    grid = np.linspace(*recorded.ends_degc, GRID)
    known = known_at(curves, everything, choice, grid)
    models = thermal_models(choice.fit, nodes.t0_degc)
    over = OverTemperature(nodes, choice, known, *models)
    return Solved(full, _shown(full, curves, choice), over)


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


def _with_folds(shapes: tuple[ThermalShape, ...], nodes: Nodes) -> tuple[ThermalShape, ...]:
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
    n = len(curves.layout)
    p[:n] = (M @ choice.fit.q) * sd
    covariance[:n, :n] = M @ choice.fit.covariance @ M.T * np.outer(sd, sd)
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
