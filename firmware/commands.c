#include "commands.h"

#include <avr/interrupt.h>
#include <stdbool.h>

#define MAX_RATE_HZ 1000000UL

static bool is_rate;     /* after an R */
static uint32_t rate_hz;

static struct command single(uint8_t byte)
{
    is_rate = byte == 'R';
    rate_hz = 0;
    switch (byte) {
    case 'S':
        return (struct command){START, 0};
    case 'P':
        return (struct command){STOP, 0};
    case 'I':
        return (struct command){IDENTIFY, 0};
#ifdef TEST_HANG
    case 'C': /* hang with the clock stopped */
        cli();
        /* falls through */
    case 'H':
        for (;;) {
        }
#endif
    default:
        return (struct command){NOTHING, 0};
    }
}

struct command command_of(uint8_t byte)
{
    if (is_rate && byte >= '0' && byte <= '9' && rate_hz < MAX_RATE_HZ) {
        rate_hz = 10 * rate_hz + (byte - '0');
        return (struct command){NOTHING, 0};
    }
    if (is_rate && byte == '\r') {
        return (struct command){NOTHING, 0};
    }
    if (is_rate && byte == '\n' && rate_hz > 0) {
        is_rate = false;
        return (struct command){SET_RATE, rate_hz};
    }
    return single(byte);
}
