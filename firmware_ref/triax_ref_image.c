#include "triax_ref.h"

typedef struct {
    const uint8_t *bytes;
    size_t size;
    size_t at;
} reader_t;

static uint32_t next_word(reader_t *reader)
{
    uint32_t word = 0;
    int i;
    for (i = 3; i >= 0; i--) {
        word = word * 256u + reader->bytes[reader->at + (size_t)i];
    }
    reader->at += 4;
    return word;
}

static int32_t next_int(reader_t *reader)
{
    const int64_t word = next_word(reader);
    return (int32_t)((word >= INT64_C(2147483648)) ? word - INT64_C(4294967296) : word);
}

/* A number of the shape. None that is legal is large; what an int of 16 bits cannot hold becomes illegal. */
static int next_small(reader_t *reader)
{
    const int32_t word = next_int(reader);
    return (word >= -32767 && word <= 32767) ? (int)word : -32767;
}

/* CRC-32 of IEEE 802.3 by polynomial division, most significant bit of each reflected byte first. */
static uint32_t crc32(const uint8_t *bytes, size_t size)
{
    uint32_t remainder = 0xFFFFFFFFu;
    size_t i;
    int bit;
    for (i = 0; i < 8 * size; i++) {
        const uint32_t input = ((uint32_t)bytes[i / 8] >> (i % 8)) & 1u;
        const uint32_t out = (remainder >> 31) ^ input;
        remainder = (remainder << 1) ^ (out ? 0x04C11DB7u : 0u);
    }
    for (i = 0, bit = 31; i < 16; i++, bit--) {
        const uint32_t low = (remainder >> i) & 1u;
        const uint32_t high = (remainder >> bit) & 1u;
        remainder &= ~(((uint32_t)1 << i) | ((uint32_t)1 << bit));
        remainder |= (high << i) | (low << bit);
    }
    return ~remainder;
}

static int within(int32_t value, int32_t low, int32_t high)
{
    return value >= low && value <= high;
}

static int shape_is_legal(const triax_ref_t *ref)
{
    return within(ref->inverse_form, 0, 1) && within(ref->segments, 1, TRIAX_REF_MAX_SEGMENTS) &&
           within(ref->order, 0, TRIAX_REF_MAX_ORDER) && within(ref->output_shift, 1, 62) &&
           ref->raw_min < ref->raw_max && within(ref->raw_shift, 0, 31) &&
           within(ref->adjugate_shift, 0, 62) && within(ref->determinant_shift, 0, 62) &&
           (!ref->inverse_form ||
            (within(ref->reciprocal_log2, 31, 62) && within(ref->gain_shift, 1, 62)));
}

/* Sums of high words: direct form, a spare bit, no terms but dT/dt. */
static int high_words_are_legal(const triax_ref_t *ref)
{
    const int others = ref->terms & ~(TRIAX_REF_HIGH_WORDS | TRIAX_REF_RATE);
    return !ref->inverse_form && ref->output_shift > 32 && others == 0;
}

/* "TRXC" is an accelerometer, with quadratic terms or dT/dt in version 2; "TRXG" is a gyro. */
static int terms_are_legal(const triax_ref_t *ref, uint32_t magic, uint32_t version)
{
    const int terms = ref->terms;
    if (magic == 0x43585254u) {
        if (terms & TRIAX_REF_HIGH_WORDS) {
            return high_words_are_legal(ref);
        }
        return version == 1u || within(terms, 1, TRIAX_REF_QUADRATIC | TRIAX_REF_RATE);
    }
    return magic == 0x47585254u && version == 2u && (terms % 256) == TRIAX_REF_SENSITIVITY &&
           within(terms / 256, 8, 30);
}

/* "TRID", version 1, the CRC of the constants again, 236 bytes of text and numbers, CRC of all. */
static int identity_is_legal(const uint8_t *file, size_t constants, size_t size)
{
    reader_t crc_of_constants = {file, size, 0};
    reader_t reader = {file, size, constants};
    const uint32_t magic = next_word(&reader);
    const uint32_t version = next_word(&reader);
    const uint32_t repeated = next_word(&reader);
    crc_of_constants.at = constants - 4;
    if (magic != 0x44495254u || version != 1u || repeated != next_word(&crc_of_constants)) {
        return 0;
    }
    reader.at = size - 4;
    return next_word(&reader) == crc32(file, size - 4);
}

uint32_t triax_ref_open(triax_ref_t *ref, const uint8_t *file, size_t file_size)
{
    const uint8_t *const image = file;
    reader_t reader = {file, file_size, 0};
    size_t size = file_size;
    int s;
    int f;
    int k;
    size_t words;
    uint32_t magic;
    uint32_t version;
    uint32_t stated;

    if (size < 4 * (TRIAX_REF_HEADER_WORDS + 3) || size % 4 != 0) {
        return TRIAX_REF_BAD_IMAGE;
    }
    magic = next_word(&reader);
    version = next_word(&reader);
    stated = next_word(&reader);
    size = (size_t)stated;
    if ((version != 1u && version != 2u) || size != stated || size % 4 != 0 || size < 4 * (TRIAX_REF_HEADER_WORDS + 3) ||
        (file_size != size && file_size != size + TRIAX_REF_IDENTITY_SIZE)) {
        return TRIAX_REF_BAD_IMAGE;
    }
    if (file_size != size && !identity_is_legal(file, size, file_size)) {
        return TRIAX_REF_BAD_IMAGE;
    }
    ref->inverse_form = next_small(&reader);
    ref->segments = next_small(&reader);
    ref->order = next_small(&reader);
    ref->output_q = next_small(&reader);
    ref->output_shift = next_small(&reader);
    ref->raw_min = next_int(&reader);
    ref->raw_max = next_int(&reader);
    ref->raw_shift = next_small(&reader);
    ref->adjugate_shift = next_small(&reader);
    ref->determinant_shift = next_small(&reader);
    ref->reciprocal_log2 = next_small(&reader);
    ref->gain_shift = next_small(&reader);
    ref->terms = (version == 2u) ? next_small(&reader) : 0;
    if (!shape_is_legal(ref) || !terms_are_legal(ref, magic, version)) {
        return TRIAX_REF_BAD_IMAGE;
    }
    words = (size_t)(TRIAX_REF_HEADER_WORDS + 3 + ref->segments * (3 + 12 * (ref->order + 1)));
    if (version == 2u) {
        words += 1;
    }
    if (ref->terms & TRIAX_REF_QUADRATIC) {
        words += 18;
    }
    if (ref->terms & TRIAX_REF_SENSITIVITY) {
        words += 9;
    }
    if (ref->terms & TRIAX_REF_RATE) {
        words += 6;
    }
    if (size != 4u * words) {
        return TRIAX_REF_BAD_IMAGE;
    }
    ref->temp_min_code = next_int(&reader);
    ref->temp_max_code = next_int(&reader);
    for (s = 0; s < ref->segments; s++) {
        ref->segment[s].first_code = next_int(&reader);
        ref->segment[s].origin_code = next_int(&reader);
        ref->segment[s].gain = next_int(&reader);
        for (f = 0; f < 12; f++) {
            for (k = 0; k <= ref->order; k++) {
                ref->segment[s].coefficient[f][k] = next_int(&reader);
            }
        }
    }
    for (k = 0; k < 18; k++) {
        ref->quadratic[k / 6][k % 6] = (ref->terms & TRIAX_REF_QUADRATIC) ? next_int(&reader) : 0;
    }
    if (ref->terms & TRIAX_REF_RATE) {
        ref->rate_min_code = next_int(&reader);
        ref->rate_max_code = next_int(&reader);
        ref->rate_gain = next_int(&reader);
        for (k = 0; k < 3; k++) {
            ref->rate_offset[k] = next_int(&reader);
        }
    }
    for (k = 0; k < 9; k++) {
        ref->sensitivity[k / 3][k % 3] = (ref->terms & TRIAX_REF_SENSITIVITY) ? next_int(&reader) : 0;
    }
    return (next_word(&reader) == crc32(image, size - 4)) ? TRIAX_REF_OK : TRIAX_REF_BAD_IMAGE;
}

/* Vectors of either triad; force and rate_code are null pointers where they do not belong. */
static uint32_t batch(const uint8_t *image, size_t size, size_t count, const int32_t *temp_code,
                      const int32_t *rate_code, const int32_t *raw_code, const int32_t *force, int32_t *result, uint32_t *status)
{
    triax_ref_t ref;
    triax_ref_state_t state = {{{0}}, {0}};
    uint32_t temp_status = 0;
    size_t i;
    if (triax_ref_open(&ref, image, size) != TRIAX_REF_OK) {
        return TRIAX_REF_BAD_IMAGE;
    }
    for (i = 0; i < count; i++) {
        if (rate_code != NULL) {
            temp_status = triax_ref_set_temperature_rate(&state, &ref, temp_code[i], rate_code[i]);
        } else if (i == 0 || temp_code[i] != temp_code[i - 1]) {
            temp_status = triax_ref_set_temperature(&state, &ref, temp_code[i]);
        }
        status[i] = temp_status;
        status[i] |= (force == NULL)
                         ? triax_ref_apply(&state, &ref, &raw_code[3 * i], &result[3 * i])
                         : triax_ref_apply_gyro(&state, &ref, &raw_code[3 * i], &force[3 * i],
                                                &result[3 * i]);
    }
    return TRIAX_REF_OK;
}

uint32_t triax_ref_batch(const uint8_t *image, size_t size, size_t count, const int32_t *temp_code,
                         const int32_t *raw_code, int32_t *accel, uint32_t *status)
{
    return batch(image, size, count, temp_code, NULL, raw_code, NULL, accel, status);
}

uint32_t triax_ref_batch_rate(const uint8_t *image, size_t size, size_t count,
                              const int32_t *temp_code, const int32_t *rate_code,
                              const int32_t *raw_code, int32_t *accel, uint32_t *status)
{
    return batch(image, size, count, temp_code, rate_code, raw_code, NULL, accel, status);
}

uint32_t triax_ref_batch_gyro(const uint8_t *image, size_t size, size_t count,
                              const int32_t *temp_code, const int32_t *raw_code,
                              const int32_t *force, int32_t *rate, uint32_t *status)
{
    return batch(image, size, count, temp_code, NULL, raw_code, force, rate, status);
}
