/* What the fuzz targets of images share: writing words, and sealing an image with its CRC. */
#ifndef FUZZ_IMAGE_H
#define FUZZ_IMAGE_H

#include <stddef.h>
#include <stdint.h>

size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t max_size);

static inline uint32_t get_word(const uint8_t *image, size_t index)
{
    const uint8_t *p = &image[4 * index];
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static inline void put_word(uint8_t *image, size_t index, uint32_t word)
{
    int i;
    for (i = 0; i < 4; i++) {
        image[4 * index + (size_t)i] = (uint8_t)(word >> (8 * i));
    }
}

/* CRC-32 of IEEE 802.3 from a table, unlike either of the two under test. */
static inline uint32_t table_crc32(const uint8_t *data, size_t size)
{
    static uint32_t table[256];
    uint32_t crc = 0xFFFFFFFFu;
    size_t i;
    if (table[1] == 0) {
        uint32_t n;
        for (n = 0; n < 256; n++) {
            uint32_t c = n;
            int bit;
            for (bit = 0; bit < 8; bit++) {
                c = (c & 1) ? 0xEDB88320u ^ (c >> 1) : c >> 1;
            }
            table[n] = c;
        }
    }
    for (i = 0; i < size; i++) {
        crc = table[(crc ^ data[i]) & 0xFF] ^ (crc >> 8);
    }
    return ~crc;
}

static inline void seal(uint8_t *image, size_t size)
{
    put_word(image, size / 4 - 1, table_crc32(image, size - 4));
}

/* Numbers for the mutators: reproducible from libFuzzer's seed, wrapping by multiplication in 64 bits. */
static inline uint32_t draw(uint64_t *state)
{
    *state = (*state ^ (*state >> 29)) & 0xFFFFFFFFu;
    *state = *state * 2891336453u + 747796405u;
    return (uint32_t)(*state >> 16);
}

/* A word of any magnitude, often at a limit. */
static inline uint32_t draw_word(uint64_t *state)
{
    static const uint32_t limits[] = {0u, 1u, 0x7FFFFFFFu, 0x80000000u, 0x80000001u, 0xFFFFFFFFu, 0x40000000u};
    const uint32_t kind = draw(state) % 4;
    const uint32_t value = draw(state) >> (draw(state) % 32);
    if (kind == 0) {
        return limits[value % 7];
    }
    return (kind == 1) ? ~value : value;
}

#endif
