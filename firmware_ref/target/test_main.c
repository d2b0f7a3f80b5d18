/*
 * test_main.c - the generated routine and the reference on the target, over vectors made here.
 *
 * target_case.h (written by triaxcal/targets/vectors.py) has the ranges, the boundary tables and
 * the image; the compile command has CASE_VECTORS, how many vectors. Printed: the answer of the self-test, digests that Python computes from its own integer model, and how many
 * damaged and truncated images each loader refused.
 */
#include <stddef.h>
#include <stdint.h>

#include "target_case.h"
#include "target_io.h"
#include "triax_ref.h"

#ifdef CASE_GYRO
#include "triax_gyro_calib.h"
#include "triax_gyro_selftest.h"
/* With a prefix they are names of the accelerometer's. */
#undef triax_calib_t
#undef triax_state_t
#undef triax_calib_load
#undef TRIAX_CALIB
#undef TRIAX_IMAGE_SIZE
#undef TRIAX_RAW_MIN
#undef triax_selftest
#define triax_calib_t triax_gyro_calib_t
#define triax_state_t triax_gyro_state_t
#define triax_calib_load triax_gyro_calib_load
#define TRIAX_CALIB TRIAX_GYRO_CALIB
#define TRIAX_IMAGE_SIZE TRIAX_GYRO_IMAGE_SIZE
#define TRIAX_RAW_MIN TRIAX_GYRO_RAW_MIN
#define triax_selftest triax_gyro_selftest
#else
#include "triax_calib.h"
#include "triax_selftest.h"
#endif

#ifdef CASE_ANGLES
#include "triax_angles.h"
#endif

static triax_ref_t ref;
static triax_calib_t loaded;
static uint8_t damaged[TRIAX_IMAGE_SIZE];

/* The int32_t with these 32 bits. */
static int32_t signed_of(uint32_t bits)
{
    return (bits <= 0x7FFFFFFFu) ? (int32_t)bits : (-1 - (int32_t)(~bits));
}

/* 32 random bits for a counter: the finaliser of MurmurHash3. */
static uint32_t draw(uint32_t counter)
{
    uint32_t x = counter * 0x9E3779B9u;
    x = (x ^ (x >> 16)) * 0x85EBCA6Bu;
    x = (x ^ (x >> 13)) * 0xC2B2AE35u;
    return x ^ (x >> 16);
}

/* low + random below span; a span of 0 means 2^32. */
static int32_t between(int32_t low, uint32_t span, uint32_t random)
{
    return signed_of((uint32_t)low + ((span == 0u) ? random : (random % span)));
}

/* Of four vectors two are in range, one is any int32, one is picked from the boundary tables. */
static int32_t make_vector(uint32_t i, int32_t raw[3])
{
    const uint32_t kind = i & 3u;
    int32_t temp = signed_of(draw(4u * i));
    uint32_t j;
    for (j = 0u; j < 3u; j++) {
        const uint32_t random = draw((4u * i) + j + 1u);
        if (kind < 2u) {
            raw[j] = between(TRIAX_RAW_MIN, CASE_RAW_SPAN, random);
        } else if (kind == 2u) {
            raw[j] = signed_of(random);
        } else {
            raw[j] = CASE_RAW[random % CASE_RAW_COUNT];
        }
    }
    if (kind < 2u) {
        temp = between(CASE_TEMP_MIN, CASE_TEMP_SPAN, draw(4u * i));
    } else if (kind == 3u) {
        temp = CASE_TEMP[draw(4u * i) % CASE_TEMP_COUNT];
    }
    return temp;
}

/* CRC-32 of IEEE 802.3, four bits at a time, over the value's bytes, least significant first. */
static uint32_t crc_word(uint32_t crc, uint32_t value)
{
    static const uint32_t TABLE[16] = {
        0x00000000u, 0x1DB71064u, 0x3B6E20C8u, 0x26D930ACu, 0x76DC4190u, 0x6B6B51F4u,
        0x4DB26158u, 0x5005713Cu, 0xEDB88320u, 0xF00F9344u, 0xD6D6A3E8u, 0xCB61B38Cu,
        0x9B64C2B0u, 0x86D3D2D4u, 0xA00AE278u, 0xBDBDF21Cu,
    };
    uint32_t result = crc ^ value;
    int i;
    for (i = 0; i < 8; i++) {
        result = (result >> 4) ^ TABLE[result & 15u];
    }
    return result;
}

static uint32_t crc_answer(uint32_t crc, const int32_t accel[3], uint32_t status)
{
    uint32_t result = crc_word(crc, (uint32_t)accel[0]);
    result = crc_word(result, (uint32_t)accel[1]);
    result = crc_word(result, (uint32_t)accel[2]);
    return crc_word(result, status);
}

#if defined(CASE_GYRO) || defined(TRIAX_RATE_Q)
/* As in triaxcal/codegen/forces.py, which says what these are for. */
static uint32_t scramble(uint32_t value)
{
    uint32_t x = (value * 0x9E3779B9u) + 0x7F4A7C15u;
    x = (x ^ (x >> 16)) * 0x85EBCA6Bu;
    x = (x ^ (x >> 13)) * 0xC2B2AE35u;
    return x ^ (x >> 16);
}
#endif

#ifdef CASE_GYRO
static void make_force(int32_t temp, const int32_t raw[3], int32_t force[3])
{
    uint32_t mixed = scramble((uint32_t)temp);
    uint32_t j;
    for (j = 0u; j < 3u; j++) {
        mixed = scramble(mixed ^ (uint32_t)raw[j]);
    }
    for (j = 0u; j < 3u; j++) {
        const uint32_t word = scramble(mixed + j + 1u);
        if ((mixed & 3u) == 0u) {
            force[j] = 0;
        } else if ((mixed & 3u) == 1u) {
            force[j] = ((word & 1u) != 0u) ? INT32_MAX : INT32_MIN;
        } else {
            force[j] = signed_of(word);
        }
    }
}

static uint32_t run_generated(const triax_calib_t *calib, int32_t temp, const int32_t raw[3],
                              int32_t result[3])
{
    triax_state_t state;
    int32_t force[3];
    const uint32_t status = triax_gyro_set_temperature(&state, calib, temp);
    make_force(temp, raw, force);
    return status | triax_gyro_apply(&state, raw, force, result);
}

static uint32_t run_reference(int32_t temp, const int32_t raw[3], int32_t result[3])
{
    triax_ref_state_t state;
    int32_t force[3];
    const uint32_t status = triax_ref_set_temperature(&state, &ref, temp);
    make_force(temp, raw, force);
    return status | triax_ref_apply_gyro(&state, &ref, raw, force, result);
}
#else
#ifdef TRIAX_RATE_Q
static int32_t make_rate(int32_t temp)
{
    const uint32_t word = scramble((uint32_t)temp);
    if ((word & 3u) == 0u) {
        return 0;
    }
    if ((word & 3u) == 1u) {
        return CASE_RATE[(word >> 2) % CASE_RATE_COUNT];
    }
    return CASE_RATE_MIN + (int32_t)((word >> 2) % CASE_RATE_SPAN);
}
#endif

static uint32_t run_generated(const triax_calib_t *calib, int32_t temp, const int32_t raw[3],
                              int32_t result[3])
{
    triax_state_t state;
#ifdef TRIAX_RATE_Q
    const uint32_t status = triax_set_temperature_rate(&state, calib, temp, make_rate(temp));
#else
    const uint32_t status = triax_set_temperature(&state, calib, temp);
#endif
    return status | triax_apply(&state, raw, result);
}

static uint32_t run_reference(int32_t temp, const int32_t raw[3], int32_t result[3])
{
    triax_ref_state_t state;
#ifdef TRIAX_RATE_Q
    const uint32_t status = triax_ref_set_temperature_rate(&state, &ref, temp, make_rate(temp));
#else
    const uint32_t status = triax_ref_set_temperature(&state, &ref, temp);
#endif
    return status | triax_ref_apply(&state, &ref, raw, result);
}
#endif

/* Every second sample is compensated in place, as the header allows. */
static uint32_t digest_generated(const triax_calib_t *calib)
{
    uint32_t crc = 0xFFFFFFFFu;
    uint32_t i;
    for (i = 0u; i < CASE_VECTORS; i++) {
        int32_t raw[3];
        int32_t accel[3];
        int32_t *const result = ((i & 1u) != 0u) ? raw : accel;
        const int32_t temp = make_vector(i, raw);
        const uint32_t status = run_generated(calib, temp, raw, result);
        crc = crc_answer(crc, result, status);
    }
    return ~crc;
}

static uint32_t digest_reference(void)
{
    uint32_t crc = 0xFFFFFFFFu;
    uint32_t i;
    for (i = 0u; i < CASE_VECTORS; i++) {
        int32_t raw[3];
        int32_t accel[3];
        const int32_t temp = make_vector(i, raw);
        const uint32_t status = run_reference(temp, raw, accel);
        crc = crc_answer(crc, accel, status);
    }
    return ~crc;
}

#ifdef CASE_ANGLES
/* Accelerations of every size and sign, axis by axis. */
static uint32_t digest_angles(void)
{
    uint32_t crc = 0xFFFFFFFFu;
    uint32_t i;
    for (i = 0u; i < CASE_VECTORS; i++) {
        const uint32_t first = draw(4u * i);
        triax_angle_t angle[2];
        int32_t accel[3];
        uint32_t j;
        for (j = 0u; j < 3u; j++) {
            const uint32_t shift = (first & 15u) + ((first >> (8u + (4u * j))) & 15u);
            const uint32_t size = draw((4u * i) + j + 1u) >> shift;
            accel[j] = signed_of((((first >> (20u + j)) & 1u) != 0u) ? (0u - size) : size);
        }
        {
            const uint32_t status = triax_angles(accel, angle);
            crc = crc_word(crc, (uint32_t)angle[0]);
            crc = crc_word(crc, (uint32_t)angle[1]);
            crc = crc_word(crc, status);
        }
    }
    return ~crc;
}
#endif

static void print_line(const char *name, uint32_t value)
{
    target_print(name);
    target_print(" ");
    target_print_hex(value);
    target_print("\n");
}

/* One bit of every byte flipped in turn, then every shorter size. */
static void try_damage(void)
{
    uint32_t refused = 0u;
    uint32_t refused_by_reference = 0u;
    uint32_t i;
    for (i = 0u; i < TRIAX_IMAGE_SIZE; i++) {
        damaged[i] = CASE_IMAGE[i];
    }
    for (i = 0u; i < TRIAX_IMAGE_SIZE; i++) {
        damaged[i] = (uint8_t)(damaged[i] ^ (1u << (draw(i) & 7u)));
        refused += (triax_calib_load(&loaded, damaged, sizeof damaged) == TRIAX_STATUS_BAD_IMAGE);
        refused_by_reference += (triax_ref_open(&ref, damaged, sizeof damaged) == TRIAX_REF_BAD_IMAGE);
        damaged[i] = CASE_IMAGE[i];
    }
    for (i = 0u; i < TRIAX_IMAGE_SIZE; i++) {
        refused += (triax_calib_load(&loaded, damaged, (size_t)i) == TRIAX_STATUS_BAD_IMAGE);
        refused_by_reference += (triax_ref_open(&ref, damaged, (size_t)i) == TRIAX_REF_BAD_IMAGE);
    }
    print_line("refused", refused);
    print_line("refused_by_reference", refused_by_reference);
}

int main(void)
{
    print_line("selftest", triax_selftest());
    print_line("generated", digest_generated(&TRIAX_CALIB));
    try_damage();
    print_line("load", triax_calib_load(&loaded, CASE_IMAGE, sizeof CASE_IMAGE));
    print_line("image", digest_generated(&loaded));
    print_line("open", triax_ref_open(&ref, CASE_IMAGE, sizeof CASE_IMAGE));
    print_line("reference", digest_reference());
#ifdef CASE_ANGLES
    print_line("angles", digest_angles());
#endif
    return 0;
}
