/* triax_memory.c - see triax_memory.h. */
#include "triax_memory.h"

/* The bits of a signed word: two's complement, as int32_t guarantees. */
static void put_signed(uint8_t *bytes, int32_t value)
{
    triax_store_put_word(bytes, (uint32_t)value);
}

static void copy(uint8_t *to, const uint8_t *from, uint32_t size)
{
    uint32_t i;

    for (i = 0u; i < size; i++) {
        to[i] = from[i];
    }
}

uint32_t triax_memory_file_size(const triax_xcp_t *xcp)
{
    return xcp->store->config->file_size;
}

uint32_t triax_memory_is_storing(const triax_xcp_t *xcp)
{
    return (xcp->store->status == TRIAX_STORE_BUSY) ? 1u : 0u;
}

static void write_info(triax_xcp_t *xcp)
{
    const triax_store_t *store = xcp->store;
    uint32_t slot = store->active;

    if (slot == TRIAX_STORE_NO_SLOT) {
        slot += triax_store_written(store);
    }
    triax_store_put_word(&xcp->info[TRIAX_XCP_INFO_VERSION], 1u);
    triax_store_put_word(&xcp->info[TRIAX_XCP_INFO_SHAPE], xcp->config->shape);
    triax_store_put_word(&xcp->info[TRIAX_XCP_INFO_SIZE_AT], triax_memory_file_size(xcp));
    triax_store_put_word(&xcp->info[TRIAX_XCP_INFO_SLOT], slot);
    triax_store_put_word(&xcp->info[TRIAX_XCP_INFO_SEQUENCE], store->sequence);
    triax_store_put_word(&xcp->info[TRIAX_XCP_INFO_STORE], store->status);
    triax_store_put_word(&xcp->info[TRIAX_XCP_INFO_SLOT_SIZE], store->config->slot_size);
    triax_store_put_word(&xcp->info[TRIAX_XCP_INFO_USED], xcp->page_used);
}

static void take_sample(triax_xcp_t *xcp)
{
    triax_xcp_sample_t sample = {0u, 0, 0, {0, 0, 0}, {0, 0, 0}, 0u};
    uint32_t axis;

    xcp->config->sample(xcp->config->context, &sample);
    triax_store_put_word(&xcp->sample[0], sample.count);
    put_signed(&xcp->sample[4], sample.temp_code);
    put_signed(&xcp->sample[8], sample.rate_code);
    for (axis = 0u; axis < 3u; axis++) {
        put_signed(&xcp->sample[12u + (4u * axis)], sample.raw[axis]);
        put_signed(&xcp->sample[24u + (4u * axis)], sample.accel[axis]);
    }
    triax_store_put_word(&xcp->sample[36], sample.status);
    xcp->seen[0] = 0u;
    xcp->seen[1] = 0u;
}

/* A new sample before a byte of it is read twice. */
static void see_sample(triax_xcp_t *xcp, uint32_t address, uint32_t count)
{
    uint32_t again = 0u;
    uint32_t i;

    for (i = address; i < (address + count); i++) {
        again |= xcp->seen[i / 32u] & ((uint32_t)1u << (i % 32u));
    }
    if (again != 0u) {
        take_sample(xcp);
    }
    for (i = address; i < (address + count); i++) {
        xcp->seen[i / 32u] |= (uint32_t)1u << (i % 32u);
    }
}

/* What a master reads: the block of an extension, and how long it is; NULL where there is none. */
static const uint8_t *block_of(triax_xcp_t *xcp, uint32_t extension, uint32_t *size)
{
    const uint8_t *block = NULL;

    *size = 0u;
    switch (extension) {
    case EXTENSION_FILE:
    case EXTENSION_CHANGE:
        block = (xcp->page == TRIAX_XCP_RAM_PAGE) ? xcp->ram : triax_store_file(xcp->store);
        *size = triax_memory_file_size(xcp);
        break;
    case EXTENSION_INFO:
        write_info(xcp);
        block = xcp->info;
        *size = TRIAX_XCP_INFO_SIZE;
        break;
    case EXTENSION_SAMPLE:
        block = xcp->sample;
        *size = TRIAX_XCP_SAMPLE_SIZE;
        break;
    case EXTENSION_TEXT:
        block = xcp->text;
        *size = xcp->text_size;
        break;
    default:
        /* Nothing is there. */
        break;
    }
    return block;
}

const uint8_t *triax_memory_readable(triax_xcp_t *xcp, uint32_t size)
{
    uint32_t limit;
    const uint8_t *block = block_of(xcp, xcp->extension, &limit);
    const uint8_t *found = NULL;

    if ((size > limit) || (xcp->address > (limit - size))) {
        xcp->error = ERR_OUT_OF_RANGE;
    } else if (block == NULL) {
        xcp->error = ERR_ACCESS_DENIED;
    } else {
        found = &block[xcp->address];
        xcp->address += size;
    }
    return found;
}

void triax_memory_set_address(triax_xcp_t *xcp, uint32_t extension, uint32_t address)
{
    if (extension == EXTENSION_TEXT) {
        xcp->error = ERR_OUT_OF_RANGE;
    } else {
        xcp->extension = extension;
        xcp->address = address;
        if ((extension == EXTENSION_SAMPLE) && (address == 0u)) {
            take_sample(xcp);
        }
    }
}

void triax_memory_read(triax_xcp_t *xcp, uint8_t *bytes, uint32_t count)
{
    const uint8_t *found = triax_memory_readable(xcp, count);

    if (found != NULL) {
        if (xcp->extension == EXTENSION_SAMPLE) {
            see_sample(xcp, xcp->address - count, count);
        }
        copy(bytes, found, count);
    }
}

uint32_t triax_memory_is_usable(const triax_xcp_t *xcp, uint32_t page)
{
    const uint8_t *file = triax_store_file(xcp->store);

    if (page == TRIAX_XCP_RAM_PAGE) {
        file = xcp->ram;
        if (xcp->store->config->check(file, (size_t)triax_memory_file_size(xcp)) != 0u) {
            file = NULL;
        }
    }
    return (file != NULL) ? 1u : 0u;
}

void triax_memory_use_page(triax_xcp_t *xcp, uint32_t page)
{
    xcp->page_used = page;
    xcp->config->use(xcp->config->context, (page == TRIAX_XCP_RAM_PAGE)
                                               ? xcp->ram
                                               : triax_store_file(xcp->store));
}

/* A calibration tool's change of the RAM page. */
static void change(triax_xcp_t *xcp, const uint8_t *bytes, uint32_t count)
{
    if (triax_file_change(xcp->ram, xcp->store->config, xcp->address, bytes, count) != 0u) {
        xcp->error = ERR_OUT_OF_RANGE;
    } else {
        xcp->address += count;
        if (xcp->page_used == TRIAX_XCP_RAM_PAGE) {
            triax_memory_use_page(xcp, TRIAX_XCP_RAM_PAGE);
        }
    }
}

void triax_memory_write(triax_xcp_t *xcp, const uint8_t *bytes, uint32_t count)
{
    const uint32_t limit = triax_memory_file_size(xcp);

    if (((xcp->extension != EXTENSION_FILE) && (xcp->extension != EXTENSION_CHANGE)) || (count > limit) ||
        (xcp->address > (limit - count))) {
        xcp->error = ERR_OUT_OF_RANGE;
    } else if (xcp->page != TRIAX_XCP_RAM_PAGE) {
        xcp->error = ERR_WRITE_PROTECTED;
    } else if (triax_memory_is_storing(xcp) != 0u) {
        xcp->error = ERR_CMD_BUSY;
    } else if (xcp->extension == EXTENSION_CHANGE) {
        change(xcp, bytes, count);
    } else {
        copy(&xcp->ram[xcp->address], bytes, count);
        xcp->address += count;
    }
}

void triax_memory_copy_page(triax_xcp_t *xcp)
{
    const uint8_t *file = triax_store_file(xcp->store);

    if (file == NULL) {
        xcp->error = ERR_PAGE_NOT_VALID;
    } else if (triax_memory_is_storing(xcp) != 0u) {
        xcp->error = ERR_CMD_BUSY;
    } else {
        copy(xcp->ram, file, triax_memory_file_size(xcp));
    }
}

uint32_t triax_memory_epk(triax_xcp_t *xcp)
{
    const uint8_t *file = (xcp->page_used == TRIAX_XCP_RAM_PAGE) ? xcp->ram : triax_store_file(xcp->store);

    return (file != NULL) ? triax_file_epk(file, triax_memory_file_size(xcp), xcp->epk) : 0u;
}

void triax_memory_open(triax_xcp_t *xcp)
{
    const uint8_t *file = triax_store_file(xcp->store);
    uint32_t i;

    for (i = 0u; i < TRIAX_XCP_SAMPLE_SIZE; i++) {
        xcp->sample[i] = 0u;
    }
    xcp->seen[0] = 0xFFFFFFFFu; /* the first read takes one */
    xcp->seen[1] = 0xFFFFFFFFu;
    for (i = 0u; i < triax_memory_file_size(xcp); i++) {
        xcp->ram[i] = (file != NULL) ? file[i] : (uint8_t)0xFFu;
    }
}
