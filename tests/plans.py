"""Plans shared by the tests: exact integers chosen here, never fitted, the same on every machine.

`integer_plan` builds any shape that docs/explanation/fixed-point.md allows from integers alone;
`COVERING` names a set of shapes that touches every branch of the templates; `GOLDEN` are the plans
behind tests/golden/.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from random import Random

import numpy as np

from triaxcal.fixedpoint.horner import Segment
from triaxcal.fixedpoint.inversion import InverseShifts
from triaxcal.fixedpoint.plan import Plan, Shape
from triaxcal.model.curves import PiecewisePolynomial, ThermalModel
from triaxcal.model.methods.method import DIRECT, INVERSE
from triaxcal.unit.adc import Adc
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.limits import Limits
from triaxcal.unit.thermal import ThermalChoice
from triaxcal.unit.thermometer import TemperatureSensor

INT32_MIN, INT32_MAX = -(2**31), 2**31 - 1
ROW_LIMIT, ROW_LIMIT_QUADRATIC = 2**32 - 8, 3 * 2**30
QUADRATIC_LIMIT = 2**31 - 1
SENSOR = TemperatureSensor(degc_per_code=0.0078125, degc_at_zero=0.0)

Coefficients = list[list[int]]
"""Twelve functions of one segment, constant first."""


# ---- plans from integers ----


def raw_shift_of(raw: tuple[int, int]) -> int:
    """Largest left shift, 30 at most, that keeps a range within int32: by trying each."""
    return max(
        shift
        for shift in range(31)
        if raw[0] * 2**shift >= INT32_MIN and raw[1] * 2**shift <= INT32_MAX
    )


def integer_shape(
    *,
    form: str = DIRECT,
    segments: int = 1,
    order: int = 1,
    output_shift: int = 35,
    output_q: int = 24,
    raw: tuple[int, int] = (-(2**23), 2**23 - 1),
    shifts: tuple[int, int, int, int] = (30, 29, 58, 30),
    quadratic: bool = False,
    high_words: bool = False,
) -> Shape:
    """A shape; `shifts` are those of the inverse form, ignored by the direct one."""
    return Shape(
        form=form,
        segments=segments,
        order=order,
        output_q=output_q,
        output_shift=output_shift,
        raw_min=raw[0],
        raw_max=raw[1],
        raw_shift=raw_shift_of(raw),
        inverse=InverseShifts(*shifts) if form == INVERSE else None,
        quadratic=quadratic,
        high_words=high_words,
    )


def integer_plan(
    shape: Shape,
    coefficients: Sequence[Coefficients],
    temp: tuple[int, int] = (-5120, 8960),
    firsts: Sequence[int] = (),
    rounded_by: float = 0.0,
) -> Plan:
    """A plan of given integers; `real` is what they stand for, each rounded up by `rounded_by`.

    Segments after the first start at `firsts`, by default at equal distances.
    """
    low, high = temp
    count = shape.segments
    starts = [low, *(firsts or [low + s * (high + 1 - low) // count for s in range(1, count)])]
    ends = [*starts[1:], high + 1]
    segments = []
    for first, end, rows in zip(starts, ends, coefficients, strict=True):
        origin = (first + end) // 2
        gain = 1
        while 2 * gain * max(origin - first, end - 1 - origin, 1) <= INT32_MAX:
            gain *= 2
        segments.append(Segment(first, origin, gain, np.array(rows, dtype=np.int64)))
    real = np.array([real_of(shape, rows, rounded_by) for rows in coefficients])
    plan = Plan(shape, low, high, tuple(segments), real, 2.5 / 2**31)
    return with_quadratic(plan, [[0] * 6] * 3) if shape.quadratic else plan


def with_quadratic(plan: Plan, rows: Sequence[Sequence[int]], rounded_by: float = 0.0) -> Plan:
    """The plan with these words for quadratic terms, each rounded up by `rounded_by`."""
    words = np.array(rows, dtype=np.int64)
    return replace(plan, quadratic=words, real_quadratic=words - rounded_by)


def real_of(shape: Shape, rows: Coefficients, rounded_by: float = 0.0) -> list[list[float]]:
    """What integers stand for (fixed-point.md, step H): halves and preloads taken off."""
    result = []
    for f, row in enumerate(rows):
        preload = shape.rounding_in_offset if f % 4 == 3 and shape.inverse is None else 0
        preload += 1 if f % 4 == 3 and shape.high_words else 0
        centred = [
            c - (0.5 if k < shape.order else 0) - (preload if k == 0 else 0)
            for k, c in enumerate(row)
        ]
        result.append([(c - rounded_by) / 2.0**k for k, c in enumerate(centred)])
    return result


# ---- random constants that keep step R ----


def random_function(rng: Random, order: int, budget: int, *, full: bool) -> list[int]:
    """c_0 ... c_order whose bound B_0 is at most `budget`; exactly that when `full`."""
    limit = budget
    row = []
    for _ in range(order):
        tail = max(1, int(limit * rng.choice([0.0, 0.5, 1.0, rng.random()])))
        row.append(_signed(rng, limit - tail, full=full))
        limit = min(INT32_MAX, 2 * (tail - 1) + 1)
    row.append(_signed(rng, limit, full=full))
    return row


def _signed(rng: Random, largest: int, *, full: bool) -> int:
    return rng.choice([-1, 1]) * (largest if full else int(largest * rng.random()))


def random_rows(rng: Random, order: int, *, full: bool, limit: int = ROW_LIMIT) -> Coefficients:
    """Twelve functions of the direct form; every row of `full` ones spends its limit."""
    rows: Coefficients = []
    for _ in range(3):
        left = limit - 1
        unspent = 5  # each function's bound is 1 at least, the offset's counts twice
        row = {}
        for place in rng.sample(range(4), 4):
            weight = 2 if place == 3 else 1
            unspent -= weight
            most = min(INT32_MAX, (left - unspent) // weight)
            budget = most if full else max(1, int(most * rng.random()))
            row[place] = random_function(rng, order, budget, full=full)
            left -= weight * budget
        rows += [row[place] for place in range(4)]
    return rows


def random_matrix_rows(rng: Random, order: int, size: float = 1.0) -> Coefficients:
    """Twelve functions of the inverse form: K near a multiple of the unit matrix, U0 anything.

    `size` is the share of int32 that K's diagonal fills; its slopes and cross terms are small.
    """
    rows: Coefficients = []
    diagonal = int(INT32_MAX * size * rng.uniform(0.6, 0.85)) * rng.choice([-1, 1])
    for i in range(3):
        for j in range(4):
            if j == 3:
                rows.append(random_function(rng, order, INT32_MAX // 16, full=False))
                continue
            constant = int(diagonal * (rng.uniform(0.97, 1.03) if i == j else 0.05 * rng.random()))
            slopes = [
                int(diagonal * rng.uniform(-0.01, 0.01) * 2**k / (k + 1)) for k in range(order)
            ]
            rows.append([constant, *slopes])
    return rows


def random_plan(rng: Random, shape: Shape, *, full: bool = False) -> Plan:
    """Random constants of a shape, within step R."""
    if shape.form == INVERSE:
        rows = [random_matrix_rows(rng, shape.order) for _ in range(shape.segments)]
    else:
        limit = ROW_LIMIT_QUADRATIC if shape.quadratic else ROW_LIMIT
        rows = [
            random_rows(rng, shape.order, full=full, limit=limit) for _ in range(shape.segments)
        ]
    low = rng.choice([-5120, rng.randint(-(2**29), 2**29)])
    high = low + rng.choice([shape.segments, 14080, rng.randint(shape.segments, 2**29)])
    firsts = sorted(rng.sample(range(low + 1, high + 1), shape.segments - 1))
    plan = integer_plan(shape, rows, (low, high), firsts)
    return with_quadratic(plan, random_quadratic(rng, full=full)) if shape.quadratic else plan


def random_quadratic(rng: Random, *, full: bool) -> list[list[int]]:
    """Three rows of quadratic terms; every row of `full` ones spends its limit."""
    rows = []
    for _ in range(3):
        left = QUADRATIC_LIMIT
        row = [0] * 6
        for k in rng.sample(range(6), 6):
            row[k] = _signed(rng, int(left * rng.choice([0.0, 0.5, rng.random()])), full=full)
            left -= abs(row[k])
        row[rng.randrange(6)] += left if full else 0
        rows.append(row)
    return rows


def vectors(plan: Plan, rng: Random, count: int) -> tuple[list[int], list[list[int]]]:
    """Temperatures at every limit and `count` more, each with raw codes at limits or anywhere."""
    limits = {INT32_MIN, INT32_MAX, plan.temp_min_code - 1, plan.temp_max_code + 1}
    limits |= {plan.temp_min_code, plan.temp_max_code}
    for s in plan.segments:
        limits |= {s.first_code + d for d in (-1, 0, 1)} | {s.origin_code}
    temps = sorted(limits)
    temps += [rng.randint(plan.temp_min_code, plan.temp_max_code) for _ in range(count)]
    low, high = plan.shape.raw_min, plan.shape.raw_max
    ends = [low, low, high, high, low - 1, low + 1, high - 1, high + 1, 0, INT32_MIN, INT32_MAX]

    def code() -> int:
        kind = rng.randrange(4)
        value = rng.choice(ends) if kind < 2 else rng.randint(low, high)
        value = rng.randint(INT32_MIN, INT32_MAX) if kind == 3 else value
        return min(max(value, INT32_MIN), INT32_MAX)

    return temps, [[code() for _ in range(3)] for _ in temps]


def disturbed(rng: Random, plan: Plan, over: int) -> Plan:
    """Take a plan and move one word of its constants away from zero by `over`."""
    s, f = rng.randrange(plan.shape.segments), rng.randrange(12)
    k = rng.randrange(plan.shape.order + 1)
    segment = plan.segments[s]

    def moved(value: int) -> int:
        away = over if value >= 0 else -over
        return min(max(value + away, INT32_MIN), INT32_MAX)

    field = rng.choice(
        ["coefficient"] * 4
        + ["first_code", "origin_code", "gain", "temp_min_code", "temp_max_code"]
    )
    if field.startswith("temp_"):
        return replace(plan, **{field: moved(getattr(plan, field))})
    if field == "coefficient":
        coefficients = segment.coefficients.copy()
        coefficients[f, k] = moved(int(coefficients[f, k]))
        segment = replace(segment, coefficients=coefficients)
    else:
        segment = replace(segment, **{field: moved(getattr(segment, field))})
    segments = list(plan.segments)
    segments[s] = segment
    return replace(plan, segments=tuple(segments))


# ---- shapes that touch every branch of the templates ----

_FULL32 = (INT32_MIN, INT32_MAX)
_INVERSE = {"form": INVERSE, "shifts": (30, 29, 60, 31)}
_SATURATING = {"form": INVERSE, "shifts": (30, 29, 60, 30)}

COVERING: dict[str, Shape] = {
    "direct-order-0": integer_shape(order=0),
    "direct-32-bit-two-segments": integer_shape(segments=2, order=1, raw=_FULL32),
    "direct-cubic-24-bit": integer_shape(order=3, output_shift=36),
    "direct-order-9-eight-segments": integer_shape(
        segments=8, order=9, output_shift=48, raw=(-3_000_001, 5_123_456)
    ),
    "direct-27-bit": integer_shape(order=2, output_shift=34, raw=(-(2**26), 2**26 - 1)),
    "direct-16-bit": integer_shape(order=4, output_shift=45, raw=(-(2**15), 2**15 - 1)),
    "direct-16-bit-two-spare": integer_shape(order=1, output_shift=34, raw=(-40_000, 40_001)),
    "direct-saturating-32": integer_shape(order=2, output_shift=32, raw=_FULL32),
    "direct-saturating-28-order-0": integer_shape(order=0, output_shift=28, raw=(-1000, 999)),
    "direct-positive-codes": integer_shape(order=1, output_shift=33, raw=(0, 4095)),
    "direct-two-codes": integer_shape(order=1, output_shift=34, raw=(-1, 0)),
    "direct-all-but-the-top-code": integer_shape(order=1, raw=(INT32_MIN, INT32_MAX - 1)),
    "direct-all-but-the-bottom-code": integer_shape(order=1, raw=(INT32_MIN + 1, INT32_MAX)),
    "inverse-order-2": integer_shape(order=2, output_shift=34, **_INVERSE),
    "inverse-32-bit-three-segments": integer_shape(segments=3, order=1, raw=_FULL32, **_INVERSE),
    "inverse-saturating-order-0": integer_shape(
        order=0, output_shift=31, raw=(-70_000, 70_000), **_SATURATING
    ),
    "inverse-saturating-order-3": integer_shape(
        segments=2, order=3, output_shift=32, raw=(INT32_MIN, 2**30), **_SATURATING
    ),
    "high-words-cubic-24-bit": integer_shape(order=3, high_words=True),
    "high-words-order-0-32-bit": integer_shape(
        order=0, output_shift=33, raw=_FULL32, high_words=True
    ),
    "high-words-two-segments": integer_shape(
        segments=2, order=1, output_shift=48, raw=(-3_000_001, 5_123_456), high_words=True
    ),
    "quadratic-cubic": integer_shape(order=3, quadratic=True),
    "quadratic-order-0-32-bit": integer_shape(
        order=0, output_shift=33, raw=_FULL32, quadratic=True
    ),
    "quadratic-saturating-two-segments": integer_shape(
        segments=2, order=1, output_shift=32, raw=(-70_000, 70_000), quadratic=True
    ),
    "quadratic-inverse": integer_shape(order=2, output_shift=34, quadratic=True, **_INVERSE),
    "quadratic-inverse-saturating": integer_shape(
        order=1, output_shift=31, raw=_FULL32, quadratic=True, **_SATURATING
    ),
}
"""Every branch: both forms; saturating or not; one segment or more; order 0 and above; no range
test, one test for three codes, three tests; with and without a left shift; ranges that end at
INT32_MIN or INT32_MAX; sums of high words; quadratic terms in both forms, saturating or not."""


# ---- plans from physical constants, through make_plan ----

TABLE_T0 = (
    -0.55060863, -0.00051742, 0.01639328,
    -0.01322881, -0.54854890, -0.00066841,
    -0.01466957, -0.00035441, -0.54859224,
    0.00449084, -0.00442299, -0.00347099,
)  # fmt: skip
"""Constants at +20 degC of tables 1 and 2 of P1: V/g and V."""
TABLE_SLOPES = (
    -9.30e-06, 2.69e-07, 3.52e-06,
    -7.05e-06, -1.50e-05, 5.64e-07,
    -4.57e-06, 2.28e-07, -1.77e-05,
    -5.00e-05, -7.02e-05, -7.87e-06,
)  # fmt: skip
"""Changes of their size, per degC."""


def unit_of(
    *,
    bits: int = 24,
    full_scale_v: float = 2.5,
    codes: tuple[int, int] | None = None,
    sensor: TemperatureSensor = SENSOR,
    method: str = "matrix",
    output_q: int = 24,
) -> UnitDescription:
    """A unit with all other keys at their defaults."""
    low, high = codes or (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    return UnitDescription(
        name="TEST",
        serial="TEST",
        adc=Adc(bits, full_scale_v, low, high),
        temperature_sensor=sensor,
        gravity_g=1.0,
        t0_degc=20.0,
        range_degc=None,
        polarity=None,
        estimator="auto",
        thermal=ThermalChoice("auto"),
        method=method,
        output_q=output_q,
        model_error_max_micro_g=1.0,
        limits=Limits(3e-4, 10e-4),
    )


def polynomial_model(
    *powers: Sequence[float], range_degc: tuple[float, float] = (-40.0, 70.0)
) -> ThermalModel:
    """Twelve polynomials about +20 degC: all constants, then all slopes, ..."""
    coefficients = np.array(powers, dtype=np.float64).T[None]
    return ThermalModel(20.0, PiecewisePolynomial(range_degc, (20.0,), coefficients))


# ---- the golden files ----

_CHECKED = [
    [
        [-1217976128, 2692664, -5015],
        [1175576, -84560, 425],
        [-36364339, -769639, 5229],
        [1130850, -1567374, 3148],
        [29258682, 1839679, -10597],
        [-1223585409, 4283604, -14876],
        [2370883, -97123, 2178],
        [-1022596, -2159328, 10033],
        [32504706, 1093135, -7148],
        [761759, -70022, 606],
        [-1222520132, 5109165, -20429],
        [-869245, -200917, 2296],
    ]
]
_PIECEWISE = [
    [
        [-1218694403, 1317519],
        [1196181, -38252],
        [-36081579, -500507],
        [1559780, -784240],
        [28703956, 1002514],
        [-1224756240, 2141019],
        [2417403, -80496],
        [-432311, -1079389],
        [32141267, 649806],
        [779363, -32541],
        [-1223899338, 2526003],
        [-814265, -100520],
    ],
    [
        [-1218179747, 988139],
        [1181239, -28689],
        [-36277089, -375380],
        [1253436, -588180],
        [29095563, 751886],
        [-1223919905, 1605764],
        [2385959, -60372],
        [-853947, -809542],
        [32395097, 487354],
        [766652, -24406],
        [-1222912618, 1894502],
        [-853530, -75390],
    ],
    [
        [-1217510695, 922263],
        [1161814, -26776],
        [-36531253, -350355],
        [855189, -548968],
        [29604653, 701760],
        [-1222832669, 1498713],
        [2345082, -56347],
        [-1402075, -755572],
        [32725076, 454864],
        [750127, -22779],
        [-1221629883, 1768202],
        [-904575, -70364],
    ],
]
_INVERSE_ROWS = [
    [
        [-1891725062, -3681164, -5235435],
        [-1782231, 106477, 151434],
        [56269432, 1393302, 1981584],
        [4061614, -4947802, -7036874],
        [-45338782, -2790560, -3968797],
        [-1884554855, -5937362, -8444249],
        [-2305844, 223245, 317504],
        [-3512888, -6946714, -9879772],
        [-50329672, -1808916, -2572681],
        [-1221464, 90248, 128353],
        [-1884659704, -7006088, -9964214],
        [-2949446, -778784, -1107604],
    ]
]

_QUADRATIC = [
    [31_415_926, -5_358_979, 3_238_462, -643_383, 2_795_028, -841_971],
    [-693_993, 7_510_582, 974_944, 5_923_078, -1_640_628, 6_208_998],
    [6_280_348, -253_421, -17_067_982, 148_086, 5_132_823, 664_709],
]

GOLDEN: dict[str, Plan] = {
    "direct-checked": integer_plan(
        integer_shape(order=2, output_shift=35), _CHECKED, rounded_by=0.25
    ),
    "direct-quadratic": with_quadratic(
        integer_plan(
            integer_shape(order=2, output_shift=35, quadratic=True), _CHECKED, rounded_by=0.25
        ),
        _QUADRATIC,
        rounded_by=0.25,
    ),
    "direct-left-justified-piecewise": integer_plan(
        integer_shape(segments=3, order=1, output_shift=35, raw=_FULL32),
        _PIECEWISE,
        firsts=(0, 2560),
        rounded_by=0.25,
    ),
    "direct-high-words": integer_plan(
        integer_shape(order=2, output_shift=35, high_words=True), _CHECKED, rounded_by=0.25
    ),
    "inverse-saturating": integer_plan(
        integer_shape(
            form=INVERSE,
            order=2,
            output_q=30,
            output_shift=29,
            raw=(-7_000_000, 7_500_000),
            shifts=(31, 29, 61, 31),
        ),
        _INVERSE_ROWS,
        rounded_by=0.25,
    ),
}
"""Of the size of P1's tables: 24-bit codes with a range test, the same with quadratic terms, the
same with sums of high words; codes that fill 32 bits, three segments; K inverted on the device,
24-bit codes of a narrower range, results that saturate."""
