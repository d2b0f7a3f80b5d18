"""The design: an entry that is added at run time is served by every table, page and help text."""

from __future__ import annotations

import hashlib
import json
import shutil
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from fit_cases import SEVEN, TABLE_TEMPS, cubic_truth, readings, tables_truth, unit
from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import Key
from triaxcal.base.kinds import number
from triaxcal.base.registry import Registry
from triaxcal.batch.run import Series
from triaxcal.cli.main import main
from triaxcal.codegen.crosscheck import vector_sets
from triaxcal.codegen.outputs.output import Output
from triaxcal.codegen.outputs.registry import OUTPUTS
from triaxcal.delivery import unit as delivery_module
from triaxcal.delivery.unit import deliver
from triaxcal.dynamic.blocks.registry import EXTENSIONS
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.model.curves import PiecewisePolynomial
from triaxcal.model.methods.method import INVERSE, CompensationMethod
from triaxcal.model.methods.registry import METHODS
from triaxcal.model.thermal.polynomial import PolynomialShape
from triaxcal.model.thermal.registry import THERMAL_FUNCTIONS, thermal_keys
from triaxcal.model.thermal.shape import ThermalFunction, ThermalShape, ends_of
from triaxcal.model.types import FloatArray
from triaxcal.report.files import all_files
from triaxcal.report.passport.content import Passport, passport
from triaxcal.report.series.page import series_files
from triaxcal.report.series.unit import unit_record
from triaxcal.report.summary import summary
from triaxcal.targets.cores.registry import CORES
from triaxcal.uncertainty.evaluate import uncertainty
from triaxcal.unit.description import read_unit, tilter_file, unit_of_text
from triaxcal.unit.thermal import ThermalChoice

UNITS = Path(__file__).parent.parent / "units"


# ---- a toy thermal function: Chebyshev's first four polynomials over a span ----

SPAN = Key(
    "toy_span_degc", number(1.0, 500.0), "Span of the toy.", None, "degC", "the calibrated range"
)
TO_POWERS = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [-1, 0, 2, 0], [0, -3, 0, 4]], dtype=float)
"""Chebyshev polynomials as powers, by rows."""


@dataclass(frozen=True)
class ToyShape(ThermalShape):
    name = "toy-series"

    span_degc: float

    @property
    def parameters(self) -> int:
        return 4

    @property
    def detail(self) -> str:
        return "4 terms"

    @property
    def label(self) -> str:
        return f"Toy series over {self.span_degc:g} degC"

    @property
    def settings(self) -> dict[str, float]:
        return {SPAN.name: self.span_degc}

    def basis(self, temp_degc: FloatArray | float) -> FloatArray:
        x = (np.asarray(temp_degc, dtype=np.float64) - self.t0_degc) / self.span_degc
        result: FloatArray = x[..., None] ** np.arange(4) @ TO_POWERS.T
        return result

    def curves(self, parameters: FloatArray) -> PiecewisePolynomial:
        powers = parameters @ TO_POWERS / self.span_degc ** np.arange(4)
        return PiecewisePolynomial(self.ends_degc, (self.t0_degc,), powers[None])

    def without(self, _remaining: FloatArray, _held_out: float) -> ToyShape:
        return self

    def undetermined(self, _where: str, _temps: FloatArray) -> RefusedError | None:
        return None


def toy_shape(temps: FloatArray, t0: float, span: float | None = None) -> ToyShape:
    low, high = ends_of(temps)
    return ToyShape(t0, (low, high), span or round(high - low, 3))


TOY_FUNCTION = ThermalFunction(
    name="toy-series",
    label="Toy series",
    doc="A series that only a test knows.",
    keys=(SPAN,),
    stated=lambda settings, temps, t0: (toy_shape(temps, t0, settings.get(SPAN.name)),),
    candidates=lambda temps, t0: (toy_shape(temps, t0),) if len(temps) > 4 else (),
    exact=toy_shape,
    rank=5,
)

# ---- a toy method: the constants of T0 at every temperature ----


def at_t0(thermal, target) -> PiecewisePolynomial:
    breaks = target.curves.breaks_degc
    constants = thermal.constants_at(thermal.t0_degc)
    return PiecewisePolynomial(
        (breaks[0], breaks[-1]), (thermal.t0_degc,), constants[None, :, None]
    )


TOY_METHOD = CompensationMethod(
    name="toy-frozen",
    label="Frozen at T0",
    doc="The constants of T0 alone, as only a test wants it.",
    short_label="Frozen",
    colour="#13579b",
    form=INVERSE,
    functions=at_t0,
    rank=90,
)


# ---- a toy output: the plan's order as text ----

TOY_OUTPUT = Output(
    name="toy-text",
    label="Toy text",
    doc="The order of the plan's functions.",
    files=lambda job: {"toy.txt": f"order {job.plan.shape.order}".encode()},
)


@pytest.fixture(scope="module", autouse=True)
def toys() -> Iterator[None]:
    with (
        THERMAL_FUNCTIONS.added(TOY_FUNCTION),
        METHODS.added(TOY_METHOD),
        OUTPUTS.added(TOY_OUTPUT),
    ):
        yield


def unit_with(folder: Path, thermal: str = "", rest: str = "") -> Path:
    shutil.copytree(UNITS / "AT-SIM", folder)
    text = (folder / "unit.toml").read_text(encoding="utf-8")
    text = text.replace("[thermal]\n", f"[thermal]\n{thermal}") + rest
    (folder / "unit.toml").write_text(text, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Passport:
    """AT-SIM with both toys chosen; the limits are wide, for the method does not compensate."""
    folder = unit_with(
        tmp_path_factory.mktemp("toys") / "AT-TOY",
        'model = "toy-series"\ntoy_span_degc = 90\n',
        '[compensation]\nmethod = "toy-frozen"\n[limits]\nat_t0_g = 0.5\nover_range_g = 0.5\n',
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(delivery_module, "vector_sets", partial(vector_sets, random_vectors=5_000))
        return passport(deliver(folder), {})


@pytest.fixture(scope="module")
def files(made: Passport) -> dict[str, str]:
    return {
        name: content.decode(errors="replace")
        for name, content in all_files(made.delivery, made).items()
    }


SHAPE = "Toy series over 90 degC"


def test_the_generated_c_names_them(files: dict[str, str]) -> None:
    assert (
        "method Frozen at T0: K(T) and U0(T) as fitted, inverted on the device"
        in files["triax_calib.h"]
    )
    assert f"thermal model: {SHAPE}" in files["triax_calib.h"]


def test_the_terminal_shows_their_labels(made: Passport) -> None:
    text = summary(made, ["a"], "build")
    words = " ".join(text.split())
    assert f"thermal model {SHAPE}, bias by" in words
    assert "method Frozen at T0: K(T) and U0(T)" in words
    assert f"* {SHAPE}" in text
    head = next(line for line in text.splitlines() if line.startswith("max | |a| - g |"))
    assert head.index(" before ") < head.index(" Frozen ") < head.index(" matrix ")
    assert "toy-" not in text


def test_the_passport_s_page_shows_them(files: dict[str, str]) -> None:
    page = files["passport.html"]
    assert "Toy series over 90 °C" in page
    assert "Frozen at T0, LSB" in page
    assert "toy-" not in page


def test_the_pictures_have_their_colours_and_labels(files: dict[str, str]) -> None:
    assert "Frozen at T0 (delivered)" in files["residuals.svg"]
    assert "#13579b" in files["residuals.svg"]
    assert "toy-" not in files["residuals.svg"]


def test_the_json_has_their_names_and_labels(files: dict[str, str]) -> None:
    calibration = json.loads(files["calibration.json"])
    assert calibration["thermal_model"]["kind"] == "toy-series"
    assert calibration["thermal_model"]["label"] == SHAPE
    assert [c["label"] for c in calibration["candidates"] if c["chosen"]] == [SHAPE]
    verification = json.loads(files["verification.json"])
    assert verification["method"] == "toy-frozen"
    assert set(verification["residuals_g"]) == {"before", *METHODS.names}


def test_an_output_is_delivered_and_hashed_with_the_others(files: dict[str, str]) -> None:
    assert files["toy.txt"] == "order 0"
    digest = hashlib.sha256(b"order 0").hexdigest()
    assert json.loads(files["verification.json"])["files_sha256"]["toy.txt"] == digest
    assert json.loads(files["passport.json"])["files_sha256"]["toy.txt"] == digest
    assert "toy.txt" in files["passport.html"]


def test_the_method_is_run_like_the_others(made: Passport) -> None:
    """Frozen at T0 is what "before" computes in floats: the same but for the rounding of the C."""
    before, frozen = made.delivery.methods[0], made.delivery.chosen
    differences = [
        abs(a.error_g - b.error_g) for a, b in zip(before.residuals, frozen.residuals, strict=True)
    ]
    unit_ = made.delivery.unit
    # Half a code in each axis of the reading, and the proven error of the arithmetic.
    code_g = unit_.adc.volts_per_code / 0.5
    assert max(differences) <= 3 * code_g + 2 * made.delivery.bound.lsb * 2.0**-unit_.output_q


def test_the_series_page_shows_them(made: Passport) -> None:
    record = unit_record(made)
    assert record["shape"].startswith("Frozen at T0, order 0")
    found = series_files(Series({"AT-TOY": {"record": record}}))
    assert SHAPE in found["series.html"].decode()
    assert SHAPE in json.loads(found["series.json"])["records"][0]["thermal_model"]


def test_auto_tries_the_function_and_scores_itself() -> None:
    """It spans the cubics, so it scores as the polynomial of order 3 does, to rounding."""
    made = calibrate(unit(), readings(cubic_truth(), SEVEN, sd_v=1e-6, count=100))
    rows = {c.label: c for c in made.candidates if c.estimator == made.estimator}
    toy, cubic = rows["Toy series over 110 degC"], rows["polynomial of order 3"]
    assert toy.parameters == 4
    assert toy.held_out_g == pytest.approx(cubic.held_out_g, rel=1e-6)
    assert toy.fit_residual_g == pytest.approx(cubic.fit_residual_g, rel=1e-6)


def test_the_uncertainty_names_it_as_the_rival() -> None:
    """Nothing is held out of three temperatures: the other exact function is what is compared."""
    data = readings(tables_truth, TABLE_TEMPS)
    # The toy needs four points to be exact; its polynomial of three temperatures stands in.
    parabola = replace(
        TOY_FUNCTION,
        name="toy-parabola",
        candidates=lambda _temps, _t0: (),
        exact=lambda temps, t0: Named(t0, ends_of(temps), 2),
        rank=1,
    )
    with THERMAL_FUNCTIONS.added(parabola):
        unit_ = unit()
        calibration = calibrate(unit_, data)
        found = uncertainty(unit_, data, calibration, None)
    origins = [s.origin for s in found.sources if s.key == "thermal_model"]
    assert len(origins) == 1
    assert "taken from the distance to a toy parabola through the same readings" in origins[0]


@dataclass(frozen=True)
class Named(PolynomialShape):
    name = "toy-parabola"

    @property
    def label(self) -> str:
        return "toy parabola"


def test_its_keys_are_keys_of_unit_toml(tmp_path: Path) -> None:
    read = read_unit(unit_with(tmp_path / "A", 'model = "toy-series"\ntoy_span_degc = 90\n'))
    assert read.thermal == ThermalChoice("toy-series", {"toy_span_degc": 90.0})
    (table,) = [t for t in tilter_file().tables if t.name == "thermal"]
    docs = {key.name: key.doc for key in table.keys}
    assert docs["toy_span_degc"] == 'Span of the toy; with model = "toy-series" only.'
    assert "toy-series: A series that only a test knows." in docs["model"]
    (method,) = [k for t in tilter_file().tables for k in t.keys if k.name == "method"]
    assert "toy-frozen: The constants of T0 alone, as only a test wants it." in method.doc
    assert "toy-frozen" in method.kind.schema["enum"]


REFUSALS = {
    "toy_span_degc = 90\n": (
        'unit.toml, [thermal] toy_span_degc: given with model = "auto"; expected it with '
        'model = "toy-series" only; remove it, or choose that model'
    ),
    'model = "toy-series"\norder = 3\n': (
        'unit.toml, [thermal] order: given with model = "toy-series"; expected it with model = '
        '"polynomial" only; remove it, or choose that model'
    ),
    'model = "toy-series"\ntoy_span_degc = 0\n': (
        "unit.toml, [thermal] toy_span_degc: found 0; expected a number from 1 to 500"
    ),
    '[compensation]\nmethod = "toy-frozn"\n': (
        "unit.toml, [compensation] method: found 'toy-frozn' (did you mean \"toy-frozen\"?); "
        'expected one of "matrix", "inverse", "additive", "additive-simplified", '
        '"additive-first-order", "toy-frozen"'
    ),
}


@pytest.mark.parametrize("lines", REFUSALS)
def test_refusals_name_them(tmp_path: Path, lines: str) -> None:
    parts = ("", lines) if lines.startswith("[") else (lines, "")
    with pytest.raises(RefusedError) as caught:
        read_unit(unit_with(tmp_path / "A", *parts))
    assert str(caught.value) == f"{tmp_path / 'A'}/{REFUSALS[lines]}"


def test_the_help_lists_them() -> None:
    shown = CliRunner().invoke(main, ["calib", "--help"])
    words = " ".join(shown.output.split())
    assert "toy-series A series that only a test knows." in words
    assert "toy-frozen The constants of T0 alone, as only a test wants it." in words


# ---- entries that are wrong ----


@pytest.mark.parametrize("part", ["label", "doc", "short_label", "colour", "form"])
def test_an_entry_without_a_part_is_named(part: str) -> None:
    wrong = replace(TOY_METHOD, name="toy-broken", **{part: ""})
    with pytest.raises(RefusedError) as caught:
        METHODS.add(wrong)
    assert str(caught.value) == (
        f"compensation method 'toy-broken': the compensation method lacks {part}; expected name, "
        "label, doc, short_label, colour, form, functions; define every part of the entry"
    )
    assert "toy-broken" not in METHODS


def test_the_default_method_is_the_first_of_the_methods_that_there_are() -> None:
    text = (UNITS / "AT-SIM" / "unit.toml").read_text(encoding="utf-8")
    assert "method" not in text
    assert unit_of_text("U", text, "unit.toml").method == "matrix"
    with METHODS.added(replace(TOY_METHOD, name="toy-first", rank=0)):
        assert unit_of_text("U", text, "unit.toml").method == "toy-first"


def test_a_name_twice_and_a_wrong_class_are_refused() -> None:
    with pytest.raises(RefusedError, match="the name 'matrix' is taken; expected another name"):
        METHODS.add(replace(TOY_METHOD, name="matrix"))
    with pytest.raises(RefusedError, match="a ThermalFunction; expected a CompensationMethod"):
        METHODS.add(TOY_FUNCTION)  # type: ignore[arg-type]


def test_an_unknown_name_tells_those_that_there_are() -> None:
    with pytest.raises(RefusedError) as caught:
        METHODS["matrx"]
    assert "compensation method: found 'matrx' (did you mean \"matrix\"?)" in str(caught.value)


BROKEN = {
    "lacks_an_argument": (
        'ENTRY = CompensationMethod(name="x", label="x", doc="x")',
        "missing 4 required positional arguments: 'short_label', 'colour', 'form', and 'functions'",
    ),
    "lacks_words": (
        'ENTRY = CompensationMethod("x", "", "x", "x", "#000", "direct", None)',
        "the compensation method lacks label",
    ),
    "lacks_a_function": (
        'ENTRY = CompensationMethod("x", "x", "x", "x", "#000", "direct", None)',
        "the compensation method lacks functions",
    ),
    "no_python": ("ENTRY = (", "SyntaxError: '(' was never closed"),
    "raises": ("ENTRY = 1 / 0", "ZeroDivisionError: division by zero"),
    "another_class": ("ENTRY = 3", "a int; expected a CompensationMethod"),
    "missing_import": ("from triaxcal.model import nowhere", "cannot import name 'nowhere'"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_file_with_a_broken_entry_is_named_when_it_is_loaded(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, message = BROKEN[case]
    package = tmp_path / f"toy_{case}"
    package.mkdir()
    (package / "__init__.py").write_text("", encoding="utf-8")
    head = "from triaxcal.model.methods.method import CompensationMethod\n"
    (package / "broken.py").write_text(head + source, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    registry = Registry("compensation method", package.name, CompensationMethod)
    for _ in range(2):  # the second time as the first: nothing is half loaded
        with pytest.raises(RefusedError) as caught:
            registry.entries()
        assert str(caught.value).startswith(f"{package.name}.broken: ")
        assert message in str(caught.value)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "registry", [THERMAL_FUNCTIONS, METHODS, EXTENSIONS, OUTPUTS, CORES], ids=lambda r: r.kind
)
def test_threads_that_ask_first_get_every_entry(registry: Registry) -> None:  # type: ignore[type-arg]
    fresh = Registry(registry.kind, registry._packages, registry._type)
    barrier = threading.Barrier(4)

    def asked() -> tuple[str, ...]:
        barrier.wait()
        return fresh.names

    with ThreadPoolExecutor(4) as pool:
        found = [future.result() for future in [pool.submit(asked) for _ in range(4)]]
    assert found == [fresh.names] * 4
    assert len(fresh.names) >= 2


def test_an_entry_that_is_there_stays_after_it_was_added_again() -> None:
    names = METHODS.names
    with METHODS.added(METHODS["matrix"]):
        pass
    assert METHODS.names == names


@pytest.mark.parametrize(
    "registry", [THERMAL_FUNCTIONS, METHODS, EXTENSIONS, OUTPUTS, CORES], ids=lambda r: r.kind
)
def test_entries_are_words_for_people(registry: Registry) -> None:  # type: ignore[type-arg]
    assert len(registry.names) == len(set(registry.names)) >= 2
    for entry in registry:
        assert entry.doc.endswith(".")
        assert entry.doc[0].isupper()


def test_keys_of_functions_are_documented_once() -> None:
    names = [key.name for key in thermal_keys()]
    assert names[0] == "model"
    assert len(names) == len(set(names))
    (knots,) = [key for key in thermal_keys() if key.name == "knots_degc"]
    assert 'with model = "piecewise-linear" or "cubic-spline" only.' in knots.doc
    assert "piecewise-linear: T0" in knots.default_words
    assert "cubic-spline: " in knots.default_words


@pytest.mark.parametrize("temps", [SEVEN, TABLE_TEMPS, (20.0,)])
def test_settings_give_every_shape_again(temps: tuple[float, ...]) -> None:
    """calibration.json keeps settings and ends: a shape is read from them as it was."""
    at = np.array(temps)
    shapes = [s for f in THERMAL_FUNCTIONS for s in f.candidates(at, 20.0)]
    shapes += [f.exact(at, 20.0) for f in THERMAL_FUNCTIONS if len(temps) >= max(2, f.least_temps)]
    for shape in shapes:
        function = THERMAL_FUNCTIONS[shape.name]
        assert set(shape.settings) == {key.name for key in function.keys}
        again = function.stated(shape.settings, np.unique(shape.ends_degc), shape.t0_degc)
        assert again == (shape,)
