/* What the simulated board offers to the converters on its pins. */
#pragma once

#include <simavr/sim_avr.h>
#include <stdbool.h>
#include <stdint.h>

#define CLOCK_HZ 16000000u
#define CYCLES_PER_US (CLOCK_HZ / 1000000u)

/* Drive an input pin from outside: port 'B' or 'D', bit 0 to 7. */
void drive_pin(avr_t *avr, char port, int bit, bool level);

/* Call `changed` whenever the board drives this pin to another level. */
void watch_pin(avr_t *avr, char port, int bit, avr_irq_notify_t changed, void *param);

/* The firmware did to a converter what its data sheet forbids: said on stderr, where the tests look. */
void fault(const avr_t *avr, const char *what);

/* What the converter on the SPI pins answers to a byte. */
typedef uint8_t (*spi_answer_t)(avr_t *avr, uint8_t byte);

void connect_spi(avr_t *avr, unsigned fastest_hz, spi_answer_t answer);

/* When the byte that is answered began, and the one before it ended. */
struct spi_times {
    avr_cycle_count_t byte_began;
    avr_cycle_count_t byte_ended;
};

extern struct spi_times spi_times;

struct reading {
    int32_t table;
    int32_t relative;
};

/* Reading `index` of the file, which repeats. */
struct reading reading_at(uint64_t index);

/* Whether there is no file, and a reading is to be the time (us) at which its conversion began. */
bool readings_are_times(void);

void connect_hx711_pair(avr_t *avr);
void connect_ads1256(avr_t *avr);

/* `fault`: "-noisy", now and then a bit of its answer is wrong; "-hasty", three conversions follow each other in
 * 20 us, as if the board were late; or "".
 */
void connect_ads131m02(avr_t *avr, const char *fault);
