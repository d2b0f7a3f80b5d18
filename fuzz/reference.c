/*
 * libFuzzer target: triax_ref_open on any bytes, and on any header with a right size and CRC.
 * What it opens it must have read whole: another image of the same bytes opens as well.
 */
#include <stdlib.h>
#include <string.h>

#include "image.h"
#include "triax_ref.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static triax_ref_t ref;
    uint8_t *image = malloc(size ? size : 1);
    memcpy(image, data, size);
    if (triax_ref_open(&ref, image, size) == TRIAX_REF_OK) {
        if (ref.segments < 1 || ref.segments > TRIAX_REF_MAX_SEGMENTS || ref.order < 0 ||
            ref.order > TRIAX_REF_MAX_ORDER || get_word(image, size / 4 - 1) != table_crc32(image, size - 4)) {
            abort();
        }
    }
    free(image);
    return 0;
}

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max_size, unsigned int seed)
{
    uint64_t state = seed;
    const uint32_t what = draw(&state) % 8;
    if (what < 4) {
        size = LLVMFuzzerMutate(data, size, max_size);
    } else if (size >= 4 * TRIAX_REF_HEADER_WORDS) {
        put_word(data, draw(&state) % TRIAX_REF_HEADER_WORDS, draw_word(&state) % 80u);
    }
    if (what == 7 || size < 4 * (TRIAX_REF_HEADER_WORDS + 3)) {
        return size;
    }
    if (what != 6) {
        /* As many words as the header says, if there is room. */
        const size_t segments = get_word(data, 4);
        const size_t order = get_word(data, 5);
        if (segments <= TRIAX_REF_MAX_SEGMENTS && order <= TRIAX_REF_MAX_ORDER) {
            const size_t wanted = 4 * (TRIAX_REF_HEADER_WORDS + 3 + segments * (3 + 12 * (order + 1)));
            if (wanted <= max_size) {
                if (wanted > size) {
                    memset(&data[size], 0, wanted - size);
                }
                size = wanted;
            }
        }
    }
    size -= size % 4;
    put_word(data, 0, 0x43585254u);
    put_word(data, 1, 1);
    put_word(data, 2, (uint32_t)size);
    seal(data, size);
    return size;
}
