/* triax_store.c - see triax_store.h. */
#include "triax_store.h"

/* A record: four words, little-endian. The rest of its bytes is 0xFF. */
#define RECORD_MAGIC 0x52585254u /* "TRXR" */
#define RECORD_SEQUENCE 4u
#define RECORD_FILE_CRC 8u
#define RECORD_CRC 12u

#define PHASE_ERASE 0u
#define PHASE_PROGRAM 1u
#define PHASE_CHECK 2u
#define PHASE_RECORD 3u
#define PHASE_SWITCH 4u

#define ERASED 0xFFu

uint32_t triax_store_get_word(const uint8_t *bytes)
{
    return (uint32_t)bytes[0] | ((uint32_t)bytes[1] << 8) | ((uint32_t)bytes[2] << 16) |
           ((uint32_t)bytes[3] << 24);
}

void triax_store_put_word(uint8_t *bytes, uint32_t word)
{
    bytes[0] = (uint8_t)(word & 0xFFu);
    bytes[1] = (uint8_t)((word >> 8) & 0xFFu);
    bytes[2] = (uint8_t)((word >> 16) & 0xFFu);
    bytes[3] = (uint8_t)((word >> 24) & 0xFFu);
}

uint32_t triax_store_crc32(const uint8_t *bytes, uint32_t size)
{
    uint32_t crc = 0xFFFFFFFFu;
    uint32_t i;
    uint32_t bit;

    for (i = 0u; i < size; i++) {
        crc ^= bytes[i];
        for (bit = 0u; bit < 8u; bit++) {
            crc = ((crc & 1u) != 0u) ? ((crc >> 1) ^ 0xEDB88320u) : (crc >> 1);
        }
    }
    return crc ^ 0xFFFFFFFFu;
}

/* Sequence number of a slot; 0 where its record or its file is not valid. */
static uint32_t sequence_of(const triax_store_config_t *config, uint32_t slot)
{
    const uint8_t *file = config->slot[slot];
    const uint8_t *record = &file[config->slot_size - TRIAX_STORE_RECORD_SIZE];
    uint32_t sequence = 0u;

    if ((triax_store_get_word(record) == RECORD_MAGIC) &&
        (triax_store_get_word(&record[RECORD_CRC]) == triax_store_crc32(record, RECORD_CRC)) &&
        (triax_store_get_word(&record[RECORD_FILE_CRC]) == triax_store_crc32(file, config->file_size)) &&
        (config->check(file, (size_t)config->file_size) == 0u)) {
        sequence = triax_store_get_word(&record[RECORD_SEQUENCE]);
    }
    return sequence;
}

static void find_active(triax_store_t *store)
{
    const uint32_t first = sequence_of(store->config, 0u);
    const uint32_t second = sequence_of(store->config, 1u);

    store->active = TRIAX_STORE_NO_SLOT;
    store->sequence = 0u;
    if (second > first) {
        store->active = 1u;
        store->sequence = second;
    } else if (first > 0u) {
        store->active = 0u;
        store->sequence = first;
    } else {
        /* Neither slot has a calibration. */
    }
}

uint32_t triax_store_open(triax_store_t *store, const triax_store_config_t *config)
{
    const uint32_t unit = config->unit;
    uint32_t refused = 0u;

    store->config = config;
    store->file = NULL;
    store->active = TRIAX_STORE_NO_SLOT;
    store->sequence = 0u;
    store->status = TRIAX_STORE_IDLE;
    store->phase = PHASE_ERASE;
    store->offset = 0u;
    if ((unit == 0u) || (unit > TRIAX_STORE_UNIT_MAX) || ((unit & (unit - 1u)) != 0u)) {
        refused = 1u;
    } else if ((config->slot_size < TRIAX_STORE_RECORD_SIZE) || ((config->slot_size & (unit - 1u)) != 0u) ||
               (config->file_size > (config->slot_size - TRIAX_STORE_RECORD_SIZE)) ||
               (((config->file_size + (unit - 1u)) & ~(unit - 1u)) >
                (config->slot_size - TRIAX_STORE_RECORD_SIZE))) {
        refused = 1u;
    } else {
        find_active(store);
    }
    return refused;
}

const uint8_t *triax_store_file(const triax_store_t *store)
{
    return (store->active < TRIAX_STORE_NO_SLOT) ? store->config->slot[store->active] : NULL;
}

uint32_t triax_store_written(const triax_store_t *store)
{
    const uint32_t end = store->config->slot_size;
    uint32_t found = 0u;
    uint32_t slot;
    uint32_t i;

    for (slot = 0u; slot < TRIAX_STORE_NO_SLOT; slot++) {
        for (i = end - TRIAX_STORE_RECORD_SIZE; i < end; i++) {
            if (store->config->slot[slot][i] != ERASED) {
                found |= (uint32_t)1u << slot;
            }
        }
    }
    return found;
}

/* The slot that a new file goes to. */
static uint32_t target_of(const triax_store_t *store)
{
    return (store->active == 0u) ? 1u : 0u;
}

uint32_t triax_store_begin(triax_store_t *store, const uint8_t *file)
{
    if (store->status != TRIAX_STORE_BUSY) {
        store->file = file;
        store->phase = PHASE_ERASE;
        store->offset = 0u;
        store->status = TRIAX_STORE_REFUSED;
        if ((store->config->check(file, (size_t)store->config->file_size) == 0u) &&
            (store->sequence < 0xFFFFFFFFu)) {
            store->status = TRIAX_STORE_BUSY;
        }
    }
    return store->status;
}

static void erase(triax_store_t *store)
{
    const triax_store_config_t *config = store->config;
    const uint32_t slot = target_of(store);
    uint32_t failed = config->erase(config->context, slot);
    uint32_t i;

    for (i = 0u; i < config->slot_size; i++) {
        if (config->slot[slot][i] != ERASED) {
            failed = 1u;
        }
    }
    if (failed != 0u) {
        store->status = TRIAX_STORE_NOT_ERASED;
    } else {
        store->phase = PHASE_PROGRAM;
    }
}

/* Write one unit of `size` bytes of `source`, filled up with ERASED; then go on, or to `next`. */
static void write_unit(triax_store_t *store, const uint8_t *source, uint32_t size, uint32_t at, uint32_t next)
{
    const triax_store_config_t *config = store->config;
    uint8_t unit[TRIAX_STORE_UNIT_MAX];
    uint32_t i;

    for (i = 0u; i < config->unit; i++) {
        const uint32_t from = store->offset + i;
        unit[i] = (from < size) ? source[from] : (uint8_t)ERASED;
    }
    if (config->program(config->context, target_of(store), at + store->offset, unit, config->unit) != 0u) {
        store->status = TRIAX_STORE_NOT_WRITTEN;
    } else {
        store->offset += config->unit;
        if (store->offset >= size) {
            store->offset = 0u;
            store->phase = next;
        }
    }
}

static void check_written(triax_store_t *store)
{
    const triax_store_config_t *config = store->config;
    const uint8_t *written = config->slot[target_of(store)];
    uint32_t i;

    store->phase = PHASE_RECORD;
    for (i = 0u; i < config->file_size; i++) {
        if (written[i] != store->file[i]) {
            store->status = TRIAX_STORE_NOT_WRITTEN;
        }
    }
    if (config->check(written, (size_t)config->file_size) != 0u) {
        store->status = TRIAX_STORE_NOT_WRITTEN;
    }
}

static void write_record(triax_store_t *store)
{
    const triax_store_config_t *config = store->config;
    uint8_t record[TRIAX_STORE_RECORD_SIZE];
    uint32_t i;

    for (i = 0u; i < TRIAX_STORE_RECORD_SIZE; i++) {
        record[i] = (uint8_t)ERASED;
    }
    triax_store_put_word(record, RECORD_MAGIC);
    triax_store_put_word(&record[RECORD_SEQUENCE], store->sequence + 1u);
    triax_store_put_word(&record[RECORD_FILE_CRC], triax_store_crc32(store->file, config->file_size));
    triax_store_put_word(&record[RECORD_CRC], triax_store_crc32(record, RECORD_CRC));
    write_unit(store, record, TRIAX_STORE_RECORD_SIZE, config->slot_size - TRIAX_STORE_RECORD_SIZE,
               PHASE_SWITCH);
}

static void switch_over(triax_store_t *store)
{
    const uint32_t target = target_of(store);

    find_active(store);
    store->status = TRIAX_STORE_NOT_WRITTEN;
    if (store->active == target) {
        store->status = TRIAX_STORE_DONE;
    }
}

uint32_t triax_store_step(triax_store_t *store)
{
    if (store->status == TRIAX_STORE_BUSY) {
        switch (store->phase) {
        case PHASE_ERASE:
            erase(store);
            break;
        case PHASE_PROGRAM:
            write_unit(store, store->file, store->config->file_size, 0u, PHASE_CHECK);
            break;
        case PHASE_CHECK:
            check_written(store);
            break;
        case PHASE_RECORD:
            write_record(store);
            break;
        default:
            switch_over(store);
            break;
        }
    }
    return store->status;
}
