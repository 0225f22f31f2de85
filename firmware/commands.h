/* What the host says: S start, P stop, I identify, R<hz> and a newline: set the rate. */
#pragma once

#include <stdint.h>

enum order { NOTHING, START, STOP, IDENTIFY, SET_RATE };

struct command {
    enum order order;
    uint32_t rate_hz;
};

/* The command that this byte completes. Bytes that are none are passed over. */
struct command command_of(uint8_t byte);
