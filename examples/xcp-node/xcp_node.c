/*
 * xcp_node.c - a node with the generated compensation, the XCP slave and two slots of flash in a file.
 *
 *     xcp_node socket 7 flash.bin samples.bin [STOP]    on an inherited socket that carries struct can_frame
 *     xcp_node can vcan0 flash.bin samples.bin [STOP]   on a CAN device
 *
 * samples.bin stands for the sensor: rows of four int32, the temperature code and the raw codes x, y, z;
 * each sample is the next row, and after the last one comes the first. With STOP the node ends as if
 * power had failed before that byte of flash is changed.
 *
 * Ends with 0 when the socket is closed, 1 when it fails, 2 for a wrong command line, 9 at STOP.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <net/if.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <linux/can.h>
#include <linux/can/raw.h>

#include "flash_file.h"
#include "triax_calib.h"
#include "triax_comp.h"
#include "triax_xcp.h"

#ifndef NODE_REQUEST_ID
#define NODE_REQUEST_ID 0x650u
#define NODE_RESPONSE_ID 0x651u
#endif
#ifndef NODE_SERIAL
#define NODE_SERIAL ""
#endif

typedef struct {
    triax_calib_t loaded;
    int is_loaded;
    uint32_t count;
    FILE *samples;
} node_t;

/* The constants in flash or RAM, and those compiled in where there are none. */
static const triax_calib_t *constants(const node_t *node)
{
    return node->is_loaded ? &node->loaded : &TRIAX_CALIB;
}

static void use(void *context, const uint8_t *file)
{
    node_t *node = context;

    if (triax_calib_load(&node->loaded, file, TRIAX_FILE_SIZE) == TRIAX_STATUS_OK) {
        node->is_loaded = 1;
    }
}

static void sample(void *context, triax_xcp_sample_t *taken)
{
    node_t *node = context;
    triax_state_t state;
    int32_t row[4] = {0, 0, 0, 0};
    int axis;

    if (fread(row, sizeof row, 1, node->samples) != 1) {
        rewind(node->samples);
        (void)!fread(row, sizeof row, 1, node->samples);
    }
    taken->count = ++node->count;
    taken->temp_code = row[0];
    for (axis = 0; axis < 3; axis++) {
        taken->raw[axis] = row[1 + axis];
    }
    taken->status = triax_set_temperature(&state, constants(node), taken->temp_code);
    taken->status |= triax_apply(&state, taken->raw, taken->accel);
}

static int open_can(const char *device)
{
    struct sockaddr_can address;
    struct ifreq request;
    int opened = socket(PF_CAN, SOCK_RAW, CAN_RAW);

    if (opened < 0) {
        return -1;
    }
    memset(&request, 0, sizeof request);
    (void)snprintf(request.ifr_name, sizeof request.ifr_name, "%s", device);
    if (ioctl(opened, SIOCGIFINDEX, &request) != 0) {
        return -1;
    }
    memset(&address, 0, sizeof address);
    address.can_family = AF_CAN;
    address.can_ifindex = request.ifr_ifindex;
    return bind(opened, (struct sockaddr *)&address, sizeof address) == 0 ? opened : -1;
}

/* Answers one frame, if one comes within `wait_ms`. Returns 1, 0 when the socket is closed, or -1. */
static int serve(triax_xcp_t *xcp, int opened, int wait_ms)
{
    struct pollfd ready = {opened, POLLIN, 0};
    struct can_frame frame;
    struct can_frame answer;
    ssize_t size;

    if (poll(&ready, 1, wait_ms) == 0) {
        return 1;
    }
    size = read(opened, &frame, sizeof frame);
    if (size <= 0) {
        return size < 0 && errno == EINTR ? 1 : (int)size;
    }
    if (size != (ssize_t)sizeof frame || frame.can_id != NODE_REQUEST_ID) {
        return 1;
    }
    memset(&answer, 0, sizeof answer);
    answer.can_id = NODE_RESPONSE_ID;
    answer.can_dlc = (uint8_t)triax_xcp_receive(xcp, frame.data, frame.can_dlc, answer.data);
    if (answer.can_dlc == 0) {
        return 1;
    }
    return write(opened, &answer, sizeof answer) == (ssize_t)sizeof answer ? 1 : -1;
}

static int fail(const char *what)
{
    fprintf(stderr, "xcp_node: %s: %s\n", what, strerror(errno));
    return 1;
}

int main(int argc, char **argv)
{
    static triax_store_config_t flash = {
        {NULL, NULL}, FLASH_SLOT_SIZE, 8, flash_file_erase, flash_file_program, NULL, triax_calib_check,
        TRIAX_FILE_SIZE,
    };
    static uint8_t ram[TRIAX_FILE_SIZE];
    static node_t node;
    static triax_store_t store;
    static const triax_xcp_config_t config = {
        &store, TRIAX_SHAPE, ram, NODE_SERIAL, "xcp-node 1", TRIAX_CALIB_EPK, sample, use, &node,
    };
    triax_xcp_t xcp;
    const uint8_t *memory;
    int opened;
    int served;

    if ((argc != 5 && argc != 6) || (strcmp(argv[1], "socket") != 0 && strcmp(argv[1], "can") != 0)) {
        fprintf(stderr, "xcp_node: say: xcp_node socket|can NUMBER|DEVICE FLASH SAMPLES [STOP]\n");
        return 2;
    }
    memory = flash_file_open(argv[3]);
    node.samples = fopen(argv[4], "rb");
    if (node.samples != NULL) {
        (void)setvbuf(node.samples, NULL, _IONBF, 0); /* each sample is what is in the file now */
    }
    opened = strcmp(argv[1], "can") == 0 ? open_can(argv[2]) : (int)strtol(argv[2], NULL, 10);
    if (memory == NULL || node.samples == NULL || opened < 0) {
        return fail(memory == NULL ? argv[3] : node.samples == NULL ? argv[4] : argv[2]);
    }
    if (argc == 6) {
        flash_file_stop_after(strtoul(argv[5], NULL, 10));
    }
    flash.slot[0] = memory;
    flash.slot[1] = &memory[FLASH_SLOT_SIZE];
    if (triax_store_open(&store, &flash) != 0) {
        fprintf(stderr, "xcp_node: a slot is too small for a calibration\n");
        return 1;
    }
    if (triax_store_file(&store) != NULL) {
        use(&node, triax_store_file(&store));
    }
    triax_xcp_open(&xcp, &config);
    do {
        served = serve(&xcp, opened, triax_xcp_background(&xcp) != 0 ? 0 : -1);
    } while (served > 0);
    return served == 0 ? 0 : fail(argv[2]);
}
