/* Two HX711, one a gauge, on one clock line. Pins in README.md; times from Avia's data sheet, table and figure 2.
 *
 * Each chip converts at its own 80 Hz. A reading is taken when both have one, so that the relative gauge is
 * read up to 1/80 s from the table, by an amount that wanders: see README.md before you measure friction so.
 */
#include <avr/io.h>
#include <util/delay.h>

#include "clock.h"
#include "converter.h"

#define CLOCK _BV(PD2)           /* D2, to SCK of both */
#define DATA_TABLE _BV(PD3)      /* D3, from DT of the table's */
#define DATA_RELATIVE _BV(PD4)   /* D4, from DT of the relative one's */

#define RATE_HZ 80               /* RATE high */
#define OFF_US 100               /* a chip whose clock line is high for 60 us is off */
#define BITS 24
#define HIGHEST 0x7FFFFFL
#define LOWEST (-0x800000L)

const char converter_name[] = "hx711";

void converter_init(void)
{
    PORTD &= ~CLOCK;
    DDRD |= CLOCK;
    PORTD |= DATA_TABLE | DATA_RELATIVE; /* pulled up: a chip that is not there is never ready */
}

bool converter_set_rate(uint32_t asked_hz)
{
    return asked_hz == RATE_HZ;
}

uint16_t converter_rate_hz(void)
{
    return RATE_HZ;
}

/* One clock pulse; the data lines as they are at its end. An interrupt may lengthen it, by far less than 50 us. */
static uint8_t pulse(void)
{
    PORTD |= CLOCK;
    _delay_us(1);
    const uint8_t pins = PIND;
    PORTD &= ~CLOCK;
    _delay_us(1);
    return pins;
}

static int32_t sign_extended(uint32_t value)
{
    return (int32_t)(value << 8) >> 8;
}

/* Switch both off and on, so that they begin together. On one common clock (README.md) they then stay so. */
void converter_start(void)
{
    PORTD |= CLOCK;
    _delay_us(OFF_US);
    PORTD &= ~CLOCK;
}

bool converter_ready(void)
{
    return (PIND & (DATA_TABLE | DATA_RELATIVE)) == 0;
}

static bool is_saturated(int32_t value)
{
    return value == HIGHEST || value == LOWEST;
}

void converter_read(struct sample *sample)
{
    uint32_t table = 0;
    uint32_t relative = 0;
    sample->time_us = clock_us();
    for (uint8_t bit = 0; bit < BITS; bit++) {
        const uint8_t pins = pulse();
        table = table << 1 | ((pins & DATA_TABLE) != 0);
        relative = relative << 1 | ((pins & DATA_RELATIVE) != 0);
    }
    pulse();                     /* the 25th: channel A at gain 128 next time too */
    sample->table = sign_extended(table);
    sample->relative = sign_extended(relative);
    sample->missed = 0;          /* not to be known: the chips do not count */
    sample->overload = (is_saturated(sample->table) ? OVERLOAD_TABLE : 0) |
                       (is_saturated(sample->relative) ? OVERLOAD_RELATIVE : 0);
}
