/* triax_file.c - see triax_file.h. The layout is that of triax_calib.bin: docs/reference/file-formats.md. */
#include "triax_file.h"

#define SIZE_AT 8u /* of the constants, with header and CRC */
#define HEADER 12u /* magic, version and size; what `check` compares stands behind it too */
#define CRC 4u

/* From the end of the constants on. */
#define CONSTANTS_CRC_AT 8u
#define SERIAL_AT 12u
#define SERIAL_SIZE 64u
#define INPUTS_AT 88u
#define INPUTS_SIZE 32u
#define EPK_BYTES 8u /* of the hash in the EPK */
#define IDENTITY_MIN (INPUTS_AT + INPUTS_SIZE + CRC)

static uint8_t hex_digit(uint8_t value)
{
    static const uint8_t digits[16] = {48u, 49u, 50u, 51u, 52u, 53u, 54u, 55u,
                                       56u, 57u, 97u, 98u, 99u, 100u, 101u, 102u}; /* ASCII 0 to f */

    return digits[value & 15u];
}

/* Where the identity begins; 0 where there is none. */
static uint32_t identity_at(const uint8_t *file, uint32_t file_size)
{
    uint32_t at = triax_store_get_word(&file[SIZE_AT]);

    if ((file_size < IDENTITY_MIN) || (at > (file_size - IDENTITY_MIN))) {
        at = 0u;
    }
    return at;
}

uint32_t triax_file_epk(const uint8_t *file, uint32_t file_size, uint8_t epk[TRIAX_FILE_EPK_SIZE])
{
    const uint32_t at = identity_at(file, file_size);
    uint32_t length = 0u;

    if (at != 0u) {
        uint32_t i;

        while ((length < SERIAL_SIZE) && (file[at + SERIAL_AT + length] != 0u)) {
            epk[length] = file[at + SERIAL_AT + length];
            length++;
        }
        epk[length] = 32u; /* a space */
        length++;
        for (i = 0u; i < EPK_BYTES; i++) {
            const uint8_t byte = file[at + INPUTS_AT + i];
            epk[length] = hex_digit((uint8_t)(byte >> 4u));
            epk[length + 1u] = hex_digit(byte);
            length += 2u;
        }
    }
    return length;
}

/* Both CRCs, and that of the constants once more in the identity. */
static void seal(uint8_t *file, uint32_t file_size)
{
    const uint32_t size = triax_store_get_word(&file[SIZE_AT]);
    const uint32_t crc = triax_store_crc32(file, size - CRC);

    triax_store_put_word(&file[size - CRC], crc);
    if (identity_at(file, file_size) != 0u) {
        triax_store_put_word(&file[size + CONSTANTS_CRC_AT], crc);
        triax_store_put_word(&file[file_size - CRC], triax_store_crc32(file, file_size - CRC));
    }
}

static void exchange(uint8_t *file, uint8_t *bytes, uint32_t count)
{
    uint32_t i;

    for (i = 0u; i < count; i++) {
        const uint8_t before = file[i];
        file[i] = bytes[i];
        bytes[i] = before;
    }
}

/* The file comes from no inputs that anyone knows. */
static void forget_inputs(uint8_t *file, uint32_t file_size)
{
    const uint32_t at = identity_at(file, file_size);

    if (at != 0u) {
        uint32_t i;

        for (i = 0u; i < INPUTS_SIZE; i++) {
            file[at + INPUTS_AT + i] = 0u;
        }
    }
}

/* Within the constants, of a file that `check` takes: its header has a right size. */
static uint32_t is_constant(const uint8_t *file, uint32_t at, uint32_t count)
{
    const uint32_t end = triax_store_get_word(&file[SIZE_AT]) - CRC;

    return ((at >= HEADER) && (count <= end) && (at <= (end - count))) ? 1u : 0u;
}

uint32_t triax_file_change(uint8_t *file, const triax_store_config_t *config, uint32_t at,
                           const uint8_t *bytes, uint32_t count)
{
    const uint32_t file_size = config->file_size;
    uint32_t refused = 1u;

    if ((count <= TRIAX_FILE_CHANGE_MAX) && (config->check(file, (size_t)file_size) == 0u) &&
        (is_constant(file, at, count) != 0u)) {
        uint8_t other[TRIAX_FILE_CHANGE_MAX];
        uint32_t i;

        for (i = 0u; i < count; i++) {
            other[i] = bytes[i];
        }
        exchange(&file[at], other, count);
        seal(file, file_size);
        refused = config->check(file, (size_t)file_size);
        if (refused != 0u) {
            refused = 1u;
            exchange(&file[at], other, count);
        } else {
            forget_inputs(file, file_size);
        }
        seal(file, file_size);
    }
    return refused;
}
