/* No converter at all: known numbers at the set rate, to try the line, the wiring of the board and the host.
 *
 * Reading i (from 0 at each start) is table = 4099 i mod 2^24, less 2^23, a sawtooth over the whole range of
 * a 24-bit converter; relative = -1 - table. Nothing is marked as overload.
 */
#include "converter.h"
#include "pace.h"

#define STEP 4099UL
#define RANGE 0x1000000UL
#define MAX_RATE_HZ 10000

const char converter_name[] = "pattern";

static uint16_t rate_hz = 1000;
static struct pace pace;
static uint16_t steps;      /* due, and not taken yet */
static uint32_t index;      /* of the reading after the last one taken */

void converter_init(void)
{
}

bool converter_set_rate(uint32_t asked_hz)
{
    if (asked_hz < 1 || asked_hz > MAX_RATE_HZ) {
        return false;
    }
    rate_hz = asked_hz;
    return true;
}

uint16_t converter_rate_hz(void)
{
    return rate_hz;
}

void converter_start(void)
{
    index = 0;
    pace_start(&pace, rate_hz);
}

bool converter_ready(void)
{
    steps = pace_due(&pace);
    return steps > 0;
}

void converter_read(struct sample *sample)
{
    index += steps;
    sample->table = (int32_t)((index - 1) * STEP % RANGE) - (int32_t)(RANGE / 2);
    sample->relative = -1 - sample->table;
    sample->time_us = pace.due_us;
    sample->missed = steps - 1;
    sample->overload = 0;
}
