/*
 * bench_angles_floating.c - the angles as one would write them in double, for the cost alone: the
 * square root by Newton, the arc tangent by a division and a polynomial good to 3e-13 rad. That is
 * less work than the full precision of a C library.
 */
#include "bench_angles.h"

static const double HALF_TURN = 3.14159265358979323846;
static const double UNITS_PER_RADIAN = 683565275.57643158978; /* 2^32 / (2 pi) */

static double square_root(double value)
{
    double scale = 1.0;
    double scaled = value;
    double root;
    int i;
    if (value <= 0.0) {
        return 0.0;
    }
    while (scaled >= 4294967296.0) {
        scaled *= 1.0 / 4294967296.0;
        scale *= 65536.0;
    }
    while (scaled >= 4.0) {
        scaled *= 0.25;
        scale *= 2.0;
    }
    root = 0.5 + (0.42 * scaled);
    for (i = 0; i < 4; i++) {
        root = 0.5 * (root + (scaled / root));
    }
    return root * scale;
}

/*
 * For ratio >= 0. The polynomial is a minimax one, by sollya: within 3e-13 on 0 to tan(pi / 8), which
 * one reduction reaches.
 */
static double arc_tangent(double ratio)
{
    static const double C[] = {
        0.99999999999929456, -0.33333333279741889, 0.19999993314598021, -0.14285395625550851,
        0.11103607125889607, -0.089938303106455716, 0.069795858263545882, -0.037744413008916289,
    };
    const int reduced = ratio > 0.41421356237309503;
    const double t = reduced ? ((ratio - 1.0) / (ratio + 1.0)) : ratio;
    const double square = t * t;
    double sum = C[7];
    int i;
    for (i = 6; i >= 0; i--) {
        sum = C[i] + (square * sum);
    }
    return (t * sum) + (reduced ? (0.25 * HALF_TURN) : 0.0);
}

static double arc_tangent_2(double s, double c)
{
    const double high = (s < 0.0) ? -s : s;
    const double wide = (c < 0.0) ? -c : c;
    double result;
    if ((high == 0.0) && (wide == 0.0)) {
        return 0.0;
    }
    result = (high > wide) ? ((0.5 * HALF_TURN) - arc_tangent(wide / high)) : arc_tangent(high / wide);
    result = (c < 0.0) ? (HALF_TURN - result) : result;
    return (s < 0.0) ? -result : result;
}

static int32_t units(double radians)
{
    const double value = radians * UNITS_PER_RADIAN;
    /* A half turn is 2^31 units, the lowest int32_t. */
    if (value >= 2147483647.5) {
        return INT32_MIN;
    }
    return (int32_t)((value < 0.0) ? (value - 0.5) : (value + 0.5));
}

/* Zenith and tool face. */
uint32_t floating_angles(const int32_t accel[3], int32_t angle[2])
{
    const double x = (double)accel[0];
    const double y = (double)accel[1];
    const double z = (double)accel[2];
    angle[0] = units(arc_tangent_2(square_root((x * x) + (y * y)), z));
    angle[1] = units(arc_tangent_2(-y, -x));
    return 0u;
}
