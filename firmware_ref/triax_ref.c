#include "triax_ref.h"

static int64_t power_of_two(int exponent)
{
    return (int64_t)((uint64_t)1 << exponent);
}

/* floor(value / 2^exponent), by moving the value to where it cannot be negative. */
static int64_t floor_div(int64_t value, int exponent)
{
    const uint64_t zero_at = (uint64_t)1 << 63;
    if (exponent == 0) {
        return value;
    }
    return (int64_t)(((uint64_t)value + zero_at) >> exponent) - (int64_t)(zero_at >> exponent);
}

static int64_t absolute(int64_t value)
{
    return (value < 0) ? -value : value;
}

static int64_t clamp(int64_t value, int64_t low, int64_t high)
{
    if (value < low) {
        return low;
    }
    return (value > high) ? high : value;
}

static int32_t saturate(int64_t value)
{
    return (int32_t)clamp(value, INT32_MIN, INT32_MAX);
}

/* Step H: Horner's rule in Q31 temperature, each step halving and flooring. */
static int32_t thermal_function(const int32_t *c, int order, int32_t x_q31)
{
    int64_t p = c[order];
    int k;
    for (k = order - 1; k >= 0; k--) {
        p = c[k] + floor_div((int64_t)x_q31 * p, 32);
    }
    return (int32_t)p;
}

/* Step I: K^-1 by cofactors written out, one division, nine products. */
static void invert(triax_ref_state_t *state, const triax_ref_t *ref, int32_t k[3][3], const int32_t u0[3])
{
    int64_t adj[3][3];
    int64_t det;
    int64_t reciprocal;
    int64_t least = power_of_two(ref->reciprocal_log2 - 31) + 1;
    int i;
    int j;

#define MINOR(a, b, c, d) ((int64_t)k a * k d - (int64_t)k b * k c)
    adj[0][0] = MINOR([1][1], [1][2], [2][1], [2][2]);
    adj[0][1] = -MINOR([0][1], [0][2], [2][1], [2][2]);
    adj[0][2] = MINOR([0][1], [0][2], [1][1], [1][2]);
    adj[1][0] = -MINOR([1][0], [1][2], [2][0], [2][2]);
    adj[1][1] = MINOR([0][0], [0][2], [2][0], [2][2]);
    adj[1][2] = -MINOR([0][0], [0][2], [1][0], [1][2]);
    adj[2][0] = MINOR([1][0], [1][1], [2][0], [2][1]);
    adj[2][1] = -MINOR([0][0], [0][1], [2][0], [2][1]);
    adj[2][2] = MINOR([0][0], [0][1], [1][0], [1][1]);
#undef MINOR
    for (i = 0; i < 3; i++) {
        for (j = 0; j < 3; j++) {
            adj[i][j] = saturate(floor_div(adj[i][j], ref->adjugate_shift));
        }
    }
    det = floor_div(k[0][0] * adj[0][0], 2) + floor_div(k[0][1] * adj[1][0], 2) +
          floor_div(k[0][2] * adj[2][0], 2);
    det = saturate(floor_div(det, ref->determinant_shift));
    reciprocal = power_of_two(ref->reciprocal_log2) / ((absolute(det) < least) ? least : absolute(det));
    if (det < 0) {
        reciprocal = -reciprocal;
    }
    for (i = 0; i < 3; i++) {
        int64_t offset = 0;
        for (j = 0; j < 3; j++) {
            const int64_t product = adj[i][j] * reciprocal + power_of_two(ref->gain_shift - 1);
            state->gain[i][j] = saturate(floor_div(product, ref->gain_shift));
            offset += floor_div((int64_t)state->gain[i][j] * u0[j], 2);
        }
        offset = -floor_div(offset + power_of_two(29), 30);
        if (ref->output_shift > 32 && !(ref->terms & TRIAX_REF_QUADRATIC)) {
            offset += power_of_two(ref->output_shift - 33);
        }
        state->offset[i] = saturate(offset);
    }
}

/* Step R, point 3, for rows that were computed here. */
static int rows_fit(const triax_ref_state_t *state, const triax_ref_t *ref)
{
    const int with_terms = (ref->terms & (TRIAX_REF_QUADRATIC | TRIAX_REF_SENSITIVITY)) != 0;
    const int64_t row_limit = with_terms ? 3 * power_of_two(30) : power_of_two(32) - 8;
    int i;
    int j;
    for (i = 0; i < 3; i++) {
        int64_t row = 2 * absolute(state->offset[i]);
        for (j = 0; j < 3; j++) {
            row += absolute(state->gain[i][j]);
        }
        if (row >= row_limit) {
            return 0;
        }
    }
    return 1;
}

/* Step D: the offset that a changing temperature adds. */
static uint32_t add_rate(triax_ref_state_t *state, const triax_ref_t *ref, int32_t rate_code)
{
    const int64_t rate = clamp(rate_code, ref->rate_min_code, ref->rate_max_code);
    int i;
    for (i = 0; i < 3; i++) {
        const int64_t product = ref->rate_offset[i] * (rate * ref->rate_gain);
        state->offset[i] = saturate(state->offset[i] + floor_div(product + power_of_two(31), 32));
    }
    return (rate != rate_code) ? TRIAX_REF_RATE_RANGE : TRIAX_REF_OK;
}

uint32_t triax_ref_set_temperature_rate(triax_ref_state_t *state, const triax_ref_t *ref,
                                        int32_t temp_code, int32_t rate_code)
{
    const int32_t code = (int32_t)clamp(temp_code, ref->temp_min_code, ref->temp_max_code);
    uint32_t status = TRIAX_REF_OK;
    const triax_ref_segment_t *segment;
    int32_t x_q31;
    int32_t k[3][3];
    int32_t offset[3];
    int s = ref->segments - 1;
    int i;
    int j;

    if (temp_code < ref->temp_min_code) {
        status |= TRIAX_REF_TEMP_LOW;
    }
    if (temp_code > ref->temp_max_code) {
        status |= TRIAX_REF_TEMP_HIGH;
    }
    while (s > 0 && code < ref->segment[s].first_code) {
        s--;
    }
    segment = &ref->segment[s];
    x_q31 = (code - segment->origin_code) * segment->gain;
    for (i = 0; i < 3; i++) {
        for (j = 0; j < 3; j++) {
            k[i][j] = thermal_function(segment->coefficient[4 * i + j], ref->order, x_q31);
        }
        offset[i] = thermal_function(segment->coefficient[4 * i + 3], ref->order, x_q31);
    }
    if (ref->inverse_form) {
        invert(state, ref, k, offset);
    } else {
        for (i = 0; i < 3; i++) {
            for (j = 0; j < 3; j++) {
                state->gain[i][j] = k[i][j];
            }
            state->offset[i] = offset[i];
        }
    }
    if (ref->terms & TRIAX_REF_RATE) {
        status |= add_rate(state, ref, rate_code);
    }
    if (ref->inverse_form && !rows_fit(state, ref)) {
        const triax_ref_state_t zero = {{{0}}, {0}};
        *state = zero;
        status |= TRIAX_REF_BAD_IMAGE;
    }
    return status;
}

uint32_t triax_ref_set_temperature(triax_ref_state_t *state, const triax_ref_t *ref, int32_t temp_code)
{
    return triax_ref_set_temperature_rate(state, ref, temp_code, 0);
}

/* Step Q: what is added to the sums, the products being those of all three linear results. */
static void add_quadratic(const triax_ref_state_t *state, const triax_ref_t *ref, int64_t sum[3])
{
    static const int first[6] = {0, 1, 2, 0, 0, 1};
    static const int second[6] = {0, 1, 2, 1, 2, 2};
    int64_t linear[3];
    int i;
    int k;
    for (i = 0; i < 3; i++) {
        linear[i] = floor_div(sum[i], 32) + state->offset[i];
    }
    for (i = 0; i < 3; i++) {
        for (k = 0; k < 6; k++) {
            sum[i] += ref->quadratic[i][k] * floor_div(linear[first[k]] * linear[second[k]], 32);
        }
    }
}

/* Step A for sums of high words: a floor for each product, and one for the sum. */
static int64_t sum_of_high_words(const triax_ref_state_t *state, const triax_ref_t *ref, int axis, const int64_t u[3])
{
    int64_t total = state->offset[axis];
    int j;
    for (j = 0; j < 3; j++) {
        total += floor_div(state->gain[axis][j] * u[j], 32);
    }
    return floor_div(total, ref->output_shift - 32);
}

/*
 * Steps A, Q and G: the sum of three products, the terms, offset and rounding; then one floor.
 * force is looked at with a g-sensitivity only.
 */
static uint32_t apply(const triax_ref_state_t *state, const triax_ref_t *ref, const int32_t raw_code[3],
                      const int32_t force[3], int32_t result32[3])
{
    const int64_t scale = power_of_two(ref->raw_shift);
    const int quadratic = (ref->terms & TRIAX_REF_QUADRATIC) != 0;
    uint32_t status = TRIAX_REF_OK;
    int64_t u[3];
    int64_t sum[3];
    int i;

    for (i = 0; i < 3; i++) {
        const int64_t clamped = clamp(raw_code[i], ref->raw_min, ref->raw_max);
        if (clamped != raw_code[i]) {
            status |= TRIAX_REF_RAW_RANGE;
        }
        u[i] = clamped * scale;
    }
    if (ref->terms & TRIAX_REF_HIGH_WORDS) {
        for (i = 0; i < 3; i++) {
            result32[i] = (int32_t)sum_of_high_words(state, ref, i, u);
        }
        return status;
    }
    for (i = 0; i < 3; i++) {
        sum[i] = state->gain[i][0] * u[0] + state->gain[i][1] * u[1] + state->gain[i][2] * u[2];
    }
    if (quadratic) {
        add_quadratic(state, ref, sum);
    }
    for (i = 0; i < 3 && (ref->terms & TRIAX_REF_SENSITIVITY) != 0; i++) {
        int j;
        for (j = 0; j < 3; j++) {
            sum[i] += (int64_t)ref->sensitivity[i][j] * force[j];
        }
    }
    for (i = 0; i < 3; i++) {
        int64_t total = sum[i] + state->offset[i] * INT64_C(4294967296);
        int64_t result;
        if (ref->output_shift <= 32 || quadratic) {
            total += power_of_two(ref->output_shift - 1);
        }
        result = floor_div(total, ref->output_shift);
        result32[i] = saturate(result);
        if (result32[i] != result) {
            status |= TRIAX_REF_SATURATED;
        }
    }
    return status;
}

uint32_t triax_ref_apply(const triax_ref_state_t *state, const triax_ref_t *ref,
                         const int32_t raw_code[3], int32_t accel[3])
{
    static const int32_t nothing[3] = {0, 0, 0};
    return apply(state, ref, raw_code, nothing, accel);
}

uint32_t triax_ref_apply_gyro(const triax_ref_state_t *state, const triax_ref_t *ref,
                              const int32_t raw_code[3], const int32_t force[3], int32_t rate[3])
{
    return apply(state, ref, raw_code, force, rate);
}
