/* triax_xcp.c - the commands; see triax_xcp.h. Codes: ASAM MCD-1 XCP, part 2, protocol layer. */
#include "triax_memory.h"

#define COMMAND_CONNECT 0xFFu
#define COMMANDS 14u

#define POSITIVE 0xFFu
#define NEGATIVE 0xFEu

#define RESOURCE_CAL_PAG 0x01u
#define STORE_CAL_REQ 0x01u
#define XCP_CRC_32 0x09u
#define PAGE_OF_APPLICATION 0x01u
#define PAGE_OF_XCP 0x02u
#define PAGE_OF_ALL_SEGMENTS 0x80u
#define ID_ASCII 0u
#define ID_EPK 5u
#define SECOND_PAGE 1u

/* Fills in the response behind its first byte; returns the bytes of the response. */
typedef uint32_t (*handler_t)(triax_xcp_t *xcp, const uint8_t *command, size_t size, uint8_t *response);

typedef struct {
    uint8_t code;
    uint8_t size; /* bytes at least */
    handler_t handle;
} command_t;

static uint32_t on_connect(triax_xcp_t *xcp, const uint8_t *command, size_t size, uint8_t *response)
{
    (void)size;
    if (command[1] != 0u) {
        xcp->error = ERR_OUT_OF_RANGE; /* a mode of the application's own */
    } else {
        xcp->connected = 1u;
        xcp->page = TRIAX_XCP_FLASH_PAGE;
        xcp->extension = EXTENSION_FILE;
        xcp->address = 0u;
        response[1] = RESOURCE_CAL_PAG;
        response[2] = 0u; /* Intel byte order, bytes, no block mode */
        response[3] = TRIAX_XCP_PACKET;
        response[4] = TRIAX_XCP_PACKET;
        response[5] = 0u;
        response[6] = 1u; /* version 1 of the protocol */
        response[7] = 1u; /* and of the transport */
    }
    return 8u;
}

static uint32_t on_disconnect(triax_xcp_t *xcp, const uint8_t *command, size_t size, uint8_t *response)
{
    (void)command;
    (void)size;
    (void)response;
    xcp->connected = 0u;
    return 1u;
}

static uint32_t on_get_status(triax_xcp_t *xcp, const uint8_t *command, size_t size, uint8_t *response)
{
    (void)command;
    (void)size;
    response[1] = (triax_memory_is_storing(xcp) != 0u) ? (uint8_t)STORE_CAL_REQ : (uint8_t)0u;
    response[2] = 0u; /* nothing is protected by a key */
    response[3] = 0u;
    response[4] = 0u;
    response[5] = 0u;
    return 6u;
}

static uint32_t on_synch(triax_xcp_t *xcp, const uint8_t *command, size_t size, uint8_t *response)
{
    (void)command;
    (void)size;
    (void)response;
    xcp->error = ERR_CMD_SYNCH;
    return 1u;
}

static uint32_t on_get_id(triax_xcp_t *xcp, const uint8_t *command, size_t size, uint8_t *response)
{
    const char *text = NULL;
    uint32_t length = 0u;

    (void)size;
    if (command[1] == ID_ASCII) {
        text = xcp->config->name;
    } else if (command[1] == TRIAX_XCP_ID_VERSION) {
        text = xcp->config->version;
    } else if (command[1] == ID_EPK) {
        xcp->text = xcp->epk;
        length = triax_memory_epk(xcp);
        if (length == 0u) {
            text = xcp->config->epk;
        }
    } else {
        /* Of no other kind: a length of 0. */
    }
    if (text != NULL) {
        while (text[length] != '\0') {
            length++;
        }
        xcp->text = (const uint8_t *)text;
    }
    if (length != 0u) {
        xcp->text_size = length;
        xcp->extension = EXTENSION_TEXT;
        xcp->address = 0u;
    }
    response[1] = 0u; /* to be uploaded */
    response[2] = 0u;
    response[3] = 0u;
    triax_store_put_word(&response[4], length);
    return 8u;
}

static uint32_t on_set_request(triax_xcp_t *xcp, const uint8_t *command, size_t size, uint8_t *response)
{
    (void)size;
    (void)response;
    if (command[1] != STORE_CAL_REQ) {
        xcp->error = ERR_OUT_OF_RANGE;
    } else if (triax_store_begin(xcp->store, xcp->ram) != TRIAX_STORE_BUSY) {
        xcp->error = ERR_PAGE_NOT_VALID;
    } else {
        /* triax_xcp_background does it. */
    }
    return 1u;
}

static uint32_t on_set_mta(triax_xcp_t *xcp, const uint8_t *command, size_t size, uint8_t *response)
{
    (void)size;
    (void)response;
    triax_memory_set_address(xcp, command[3], triax_store_get_word(&command[4]));
    return 1u;
}

static uint32_t upload(triax_xcp_t *xcp, uint32_t count, uint8_t *response)
{
    if ((count == 0u) || (count >= TRIAX_XCP_PACKET)) {
        xcp->error = ERR_OUT_OF_RANGE;
    } else {
        triax_memory_read(xcp, &response[1], count);
    }
    return 1u + count;
}

static uint32_t on_upload(triax_xcp_t *xcp, const uint8_t *command, size_t size, uint8_t *response)
{
    (void)size;
    return upload(xcp, command[1], response);
}

static uint32_t on_short_upload(triax_xcp_t *xcp, const uint8_t *command, size_t size, uint8_t *response)
{
    uint32_t length = 1u;

    (void)size;
    triax_memory_set_address(xcp, command[3], triax_store_get_word(&command[4]));
    if (xcp->error == NO_ERROR) {
        length = upload(xcp, command[1], response);
    }
    return length;
}

static uint32_t on_download(triax_xcp_t *xcp, const uint8_t *command, size_t size, uint8_t *response)
{
    const uint32_t count = command[1];

    (void)response;
    if (size < (count + 2u)) {
        xcp->error = ERR_CMD_SYNTAX;
    } else if (count == 0u) {
        xcp->error = ERR_OUT_OF_RANGE;
    } else {
        triax_memory_write(xcp, &command[2], count);
    }
    return 1u;
}

static uint32_t on_build_checksum(triax_xcp_t *xcp, const uint8_t *command, size_t size, uint8_t *response)
{
    const uint32_t count = triax_store_get_word(&command[4]);
    const uint8_t *found = NULL;

    (void)size;
    if (count == 0u) {
        xcp->error = ERR_OUT_OF_RANGE;
    } else {
        found = triax_memory_readable(xcp, count);
    }
    if (found != NULL) {
        response[1] = XCP_CRC_32;
        response[2] = 0u;
        response[3] = 0u;
        triax_store_put_word(&response[4], triax_store_crc32(found, count));
    }
    return 8u;
}

static uint32_t on_set_cal_page(triax_xcp_t *xcp, const uint8_t *command, size_t size, uint8_t *response)
{
    const uint32_t mode = command[1];
    const uint32_t page = command[3];

    (void)size;
    (void)response;
    if (((mode & (PAGE_OF_APPLICATION | PAGE_OF_XCP)) == 0u) ||
        ((mode & ~(PAGE_OF_APPLICATION | PAGE_OF_XCP | PAGE_OF_ALL_SEGMENTS)) != 0u)) {
        xcp->error = ERR_MODE_NOT_VALID;
    } else if ((command[2] != 0u) && ((mode & PAGE_OF_ALL_SEGMENTS) == 0u)) {
        xcp->error = ERR_SEGMENT_NOT_VALID;
    } else if ((page > TRIAX_XCP_RAM_PAGE) ||
               (((mode & PAGE_OF_APPLICATION) != 0u) && (triax_memory_is_usable(xcp, page) == 0u))) {
        xcp->error = ERR_PAGE_NOT_VALID;
    } else {
        if ((mode & PAGE_OF_XCP) != 0u) {
            xcp->page = page;
        }
        if ((mode & PAGE_OF_APPLICATION) != 0u) {
            triax_memory_use_page(xcp, page);
        }
    }
    return 1u;
}

static uint32_t on_get_cal_page(triax_xcp_t *xcp, const uint8_t *command, size_t size, uint8_t *response)
{
    const uint32_t mode = command[1];

    (void)size;
    response[1] = 0u;
    response[2] = 0u;
    if (command[2] != 0u) {
        xcp->error = ERR_SEGMENT_NOT_VALID;
    } else if (mode == PAGE_OF_APPLICATION) {
        response[3] = (uint8_t)xcp->page_used;
    } else if (mode == PAGE_OF_XCP) {
        response[3] = (uint8_t)xcp->page;
    } else {
        xcp->error = ERR_MODE_NOT_VALID;
    }
    return 4u;
}

/* From flash to RAM only: the other way is SET_REQUEST. */
static uint32_t on_copy_cal_page(triax_xcp_t *xcp, const uint8_t *command, size_t size, uint8_t *response)
{
    (void)size;
    (void)response;
    if ((command[1] != 0u) || (command[3] != 0u)) {
        xcp->error = ERR_SEGMENT_NOT_VALID;
    } else if ((command[2] != TRIAX_XCP_FLASH_PAGE) || (command[4] > SECOND_PAGE)) {
        xcp->error = ERR_PAGE_NOT_VALID;
    } else if (command[4] != TRIAX_XCP_RAM_PAGE) {
        xcp->error = ERR_WRITE_PROTECTED;
    } else {
        triax_memory_copy_page(xcp);
    }
    return 1u;
}

/* The command of a code; NULL where there is none. */
static const command_t *command_of(uint8_t code)
{
    static const command_t table[COMMANDS] = {
        {0xFFu, 2u, on_connect},      {0xFEu, 1u, on_disconnect},     {0xFDu, 1u, on_get_status},
        {0xFCu, 1u, on_synch},        {0xFAu, 2u, on_get_id},         {0xF9u, 2u, on_set_request},
        {0xF6u, 8u, on_set_mta},      {0xF5u, 2u, on_upload},         {0xF4u, 8u, on_short_upload},
        {0xF3u, 8u, on_build_checksum}, {0xF0u, 3u, on_download},     {0xEBu, 4u, on_set_cal_page},
        {0xEAu, 3u, on_get_cal_page}, {0xE4u, 5u, on_copy_cal_page},
    };
    const command_t *found = NULL;
    uint32_t i;

    for (i = 0u; i < COMMANDS; i++) {
        if (table[i].code == code) {
            found = &table[i];
        }
    }
    return found;
}

void triax_xcp_open(triax_xcp_t *xcp, const triax_xcp_config_t *config)
{
    xcp->config = config;
    xcp->ram = config->ram;
    xcp->store = config->store;
    xcp->text = NULL;
    xcp->text_size = 0u;
    xcp->extension = EXTENSION_FILE;
    xcp->address = 0u;
    xcp->connected = 0u;
    xcp->page = TRIAX_XCP_FLASH_PAGE;
    xcp->page_used = TRIAX_XCP_FLASH_PAGE;
    xcp->error = NO_ERROR;
    triax_memory_open(xcp);
}

uint32_t triax_xcp_receive(triax_xcp_t *xcp, const uint8_t *command, size_t size,
                           uint8_t response[TRIAX_XCP_PACKET])
{
    uint32_t length = 0u;

    if ((size > 0u) && (size <= TRIAX_XCP_PACKET) &&
        ((xcp->connected != 0u) || (command[0] == COMMAND_CONNECT))) {
        const command_t *found = command_of(command[0]);

        xcp->error = NO_ERROR;
        response[0] = POSITIVE;
        if (found == NULL) {
            xcp->error = ERR_CMD_UNKNOWN;
        } else if (size < found->size) {
            xcp->error = ERR_CMD_SYNTAX;
        } else {
            length = found->handle(xcp, command, size, response);
        }
        if (xcp->error != NO_ERROR) {
            response[0] = NEGATIVE;
            response[1] = (uint8_t)xcp->error;
            length = 2u;
        }
    }
    return length;
}

uint32_t triax_xcp_background(triax_xcp_t *xcp)
{
    uint32_t more = triax_memory_is_storing(xcp);

    if (more != 0u) {
        const uint32_t status = triax_store_step(xcp->store);
        if (status != TRIAX_STORE_BUSY) {
            more = 0u;
        }
        if (status == TRIAX_STORE_DONE) {
            triax_memory_use_page(xcp, TRIAX_XCP_FLASH_PAGE);
        }
    }
    return more;
}
