#include "watchdog.h"

#include <avr/io.h>
#include <avr/wdt.h>

#define TIMEOUT WDTO_250MS
#define OVERDUE 6 /* times 32.8 ms: a main loop that was silent for so long had hung */
#define KEPT 0x51195A2DUL

/* Memory that a reset does not clear. It is believed only if it says KEPT, which it does not after power came. */
static struct {
    uint32_t kept;
    volatile uint8_t overdue;
    uint16_t streaming_hz;
} memory __attribute__((section(".noinit")));

static uint8_t reset_cause __attribute__((section(".noinit")));

/* Runs before main(): after a reset by the watchdog it is still on, and at its shortest time. */
__attribute__((naked, used, section(".init3"))) static void stop_watchdog(void)
{
    reset_cause = MCUSR;
    MCUSR = 0;
    wdt_disable();
}

/* Most bootloaders clear MCUSR before we see it; then how long the loop had been silent tells. */
bool watchdog_start(void)
{
    const bool is_kept = memory.kept == KEPT;
    const bool bit = is_kept && ((reset_cause & _BV(WDRF)) || memory.overdue >= OVERDUE);
    memory.kept = KEPT;
    memory.overdue = 0;
    wdt_enable(TIMEOUT);
    return bit;
}

void watchdog_alive(uint16_t streaming_hz)
{
    memory.streaming_hz = streaming_hz;
    if (memory.overdue > 0) { /* once for each tick of the clock, so that a clock that stands is a hang too */
        memory.overdue = 0;
        wdt_reset();
    }
}

uint16_t watchdog_cut_off_hz(void)
{
    return memory.streaming_hz;
}

void watchdog_count_overdue(void)
{
    if (memory.overdue < UINT8_MAX) {
        memory.overdue++;
    }
}
