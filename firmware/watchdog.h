/* Resets the board when the main loop hangs, and remembers that it did. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

/* Switch it on. True if it was the watchdog that made the board start just now. */
bool watchdog_start(void);

/* The main loop is alive. Keeps `streaming_hz`, the rate of the stream that runs (0: none), for after a reset. */
void watchdog_alive(uint16_t streaming_hz);

/* The rate of the stream that the reset has cut off, 0 if none ran. Good only if watchdog_start() said true. */
uint16_t watchdog_cut_off_hz(void);

/* Called by the clock each 32.8 ms. */
void watchdog_count_overdue(void);
