/*
 * libFuzzer target: an image that triax_calib_load accepts never leads to undefined behaviour in
 * triax_set_temperature or triax_apply, whatever the codes, and is answered as by the reference C.
 *
 * Input: an image of TRIAX_IMAGE_SIZE bytes, then rows of temp_code and raw_code[3] to run it on.
 * The mutator keeps the header (FUZZ_HEADER) and the CRC right nine times in ten, or nothing
 * would ever get past them.
 */
#include <stdlib.h>
#include <string.h>

#include "image.h"
#include "triax_comp.h"
#include "triax_ref.h"

#define WORDS (TRIAX_IMAGE_SIZE / 4)
static const uint32_t HEADER[HEADER_WORDS] = {FUZZ_HEADER};

static void compare(const triax_calib_t *calib, const triax_ref_t *ref, const int32_t codes[4])
{
    triax_state_t state;
    triax_ref_state_t ref_state;
    int32_t accel[3];
    int32_t expected[3];
    uint32_t status = triax_set_temperature(&state, calib, codes[0]);
    uint32_t expected_status = triax_ref_set_temperature(&ref_state, ref, codes[0]);
    status |= triax_apply(&state, &codes[1], accel);
    expected_status |= triax_ref_apply(&ref_state, ref, &codes[1], expected);
    if (status != expected_status || memcmp(accel, expected, sizeof accel) != 0) {
        abort();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static triax_ref_t ref;
    static const int32_t ends[] = {INT32_MIN, TRIAX_RAW_MIN, -1, 0, 1, TRIAX_RAW_MAX, INT32_MAX};
    triax_calib_t calib;
    int32_t codes[4];
    size_t at;
    size_t i;
    size_t j;

    /* A block of its own of just that size, for the address sanitizer. */
    const size_t image_size = size < TRIAX_IMAGE_SIZE ? size : TRIAX_IMAGE_SIZE;
    uint8_t *image = malloc(image_size ? image_size : 1);
    memcpy(image, data, image_size);
    if (triax_calib_load(&calib, image, image_size) != TRIAX_STATUS_OK) {
        free(image);
        return 0;
    }
    if (triax_ref_open(&ref, image, image_size) != TRIAX_REF_OK) {
        abort();
    }
    free(image);
    for (at = TRIAX_IMAGE_SIZE; at + 16 <= size; at += 16) {
        for (i = 0; i < 4; i++) {
            codes[i] = (int32_t)get_word(&data[at], i);
        }
        compare(&calib, &ref, codes);
    }
    for (i = 0; i < sizeof ends / sizeof ends[0]; i++) {
        for (j = 0; j < 8; j++) {
            const int32_t extremes[4] = {
                i == 1 ? calib.temp_min_code : i == 5 ? calib.temp_max_code : ends[i],
                (j & 1) ? TRIAX_RAW_MAX : TRIAX_RAW_MIN,
                (j & 2) ? TRIAX_RAW_MAX : TRIAX_RAW_MIN,
                (j & 4) ? ends[i] : TRIAX_RAW_MIN,
            };
            compare(&calib, &ref, extremes);
        }
    }
    return 0;
}

/* Change a word of the constants, or let libFuzzer change bytes; then make it an image again. */
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max_size, unsigned int seed)
{
    uint64_t state = seed;
    const uint32_t what = draw(&state) % 10;
    size_t i;

    if (what < 4 || size < TRIAX_IMAGE_SIZE) {
        size = LLVMFuzzerMutate(data, size, max_size);
    }
    if (what == 9 || max_size < TRIAX_IMAGE_SIZE) {
        return size;
    }
    if (size < TRIAX_IMAGE_SIZE) {
        memset(&data[size], 0, TRIAX_IMAGE_SIZE - size);
        size = TRIAX_IMAGE_SIZE;
    }
    for (i = 0; i < HEADER_WORDS; i++) {
        put_word(data, i, HEADER[i]);
    }
    if (what >= 4) {
        uint32_t changes = 1 + draw(&state) % 4;
        while (changes-- > 0) {
            const size_t index = HEADER_WORDS + draw(&state) % (WORDS - 1 - HEADER_WORDS);
            put_word(data, index, draw_word(&state));
        }
    }
    /* The first segment starts where the range does. */
    if (what != 8) {
        put_word(data, HEADER_WORDS + 2, get_word(data, HEADER_WORDS));
    }
    seal(data, TRIAX_IMAGE_SIZE);
    return size;
}
