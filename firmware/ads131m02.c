/* One ADS131M02, which converts both inputs at once: the table on input 0, the relative gauge on input 1.
 *
 * So there is no skew, and delay_s of the relative gauge is 0. The chip has a clock of its own, 2.048 MHz, and
 * sets the pace; an interrupt counts its conversions and stamps them. Pins in README.md; commands, registers and
 * times from Texas Instruments' data sheet SBAS853.
 */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>
#include <util/crc16.h>
#include <util/delay.h>

#include "clock.h"
#include "converter.h"

#define RESET _BV(PB1)           /* D9, SYNC/RESET */
#define SELECT _BV(PB2)          /* D10, CS */
#define MOSI _BV(PB3)            /* D11, DIN */
#define SCK _BV(PB5)             /* D13, SCLK */
#define DATA_READY _BV(PD2)      /* D2, DRDY, falls when a conversion is done */

#define WREG(address) (0x6000 | (address) << 7)
#define CLOCK 0x03
#define GAIN1 0x04
#define CHANNELS_ON 0x0300       /* in CLOCK; the two lowest bits, 0, are for a clock of 2.048 MHz */
#define OSR_SHIFT 2

#define RESET_MS 2               /* 2048 clocks are 1 ms */
#define REGISTERS_READY_US 20    /* after a reset, 5 are enough */
#define WORD_BYTES 3
#define CHECKED_BYTES 9          /* status and both channels, before their checksum */
#define BOTH_NEW 0x03            /* in the status: results of both inputs that were not read before */
#define MOST_WAITING 4           /* results, the two that it holds and what may come meanwhile */
#define UNSETTLED 5              /* two of another filter, and three until this one has settled */
#define CRC_START 0xFFFF

#define HIGHEST 0x7FFFFFL
#define LOWEST (-0x800000L)

#if GAIN == 1
#define GAIN_CODE 0
#elif GAIN == 2
#define GAIN_CODE 1
#elif GAIN == 4
#define GAIN_CODE 2
#elif GAIN == 8
#define GAIN_CODE 3
#elif GAIN == 16
#define GAIN_CODE 4
#elif GAIN == 32
#define GAIN_CODE 5
#elif GAIN == 64
#define GAIN_CODE 6
#elif GAIN == 128
#define GAIN_CODE 7
#else
#error "GAIN of the ADS131M02 is 1, 2, 4, 8, 16, 32, 64 or 128"
#endif

/* Rates whose whole filter is a sinc^3: 2.048 MHz / 2 / oversampling. Slower ones average over it once more. */
static const struct {
    uint16_t rate_hz;
    uint8_t osr;                 /* its code */
} speeds[] = {{1000, 3}, {2000, 2}, {4000, 1}};

const char converter_name[] = "ads131m02";

static uint8_t speed;
static uint8_t unsettled;        /* conversions that are still to be left out */
static uint16_t missed;          /* since the last sample that was read */
static struct sample latest;
static volatile uint8_t done;    /* conversions since they were last looked at */
static volatile uint32_t done_us;

ISR(INT0_vect)
{
    done++;
    done_us = clock_us();
}

static uint8_t exchange(uint8_t byte)
{
    SPDR = byte;
    while (!(SPSR & _BV(SPIF))) {
    }
    return SPDR;
}

void converter_init(void)
{
    PORTB |= SELECT | RESET;
    DDRB |= SELECT | RESET | MOSI | SCK;
    PORTD |= DATA_READY;         /* pulled up: a chip that is not there is never ready */
    SPCR = _BV(SPE) | _BV(MSTR) | _BV(CPHA); /* mode 1, 4 MHz */
    EICRA = _BV(ISC01);          /* a falling edge */
}

bool converter_set_rate(uint32_t asked_hz)
{
    for (uint8_t i = 0; i < sizeof speeds / sizeof speeds[0]; i++) {
        if (speeds[i].rate_hz == asked_hz) {
            speed = i;
            return true;
        }
    }
    return false;
}

uint16_t converter_rate_hz(void)
{
    return speeds[speed].rate_hz;
}

static void exchange_word(uint16_t word)
{
    exchange(word >> 8);
    exchange(word);
    exchange(0);
}

/* A frame always has four words, of which the last two are not looked at here. */
static void write_register(uint8_t address, uint16_t value)
{
    PORTB &= ~SELECT;
    exchange_word(WREG((uint16_t)address));
    exchange_word(value);
    exchange_word(0);
    exchange_word(0);
    PORTB |= SELECT;
}

/* Reset the chip, so that nothing of before is left in it, and set it up. */
void converter_start(void)
{
    EIMSK &= ~_BV(INT0);
    PORTB &= ~RESET;
    _delay_ms(RESET_MS);
    PORTB |= RESET;
    _delay_us(REGISTERS_READY_US);
    write_register(GAIN1, GAIN_CODE << 4 | GAIN_CODE);
    write_register(CLOCK, CHANNELS_ON | speeds[speed].osr << OSR_SHIFT);
    unsettled = UNSETTLED;
    missed = 0;
    done = 0;
    EIFR = _BV(INTF0);
    EIMSK |= _BV(INT0);
}

static int32_t value_at(const uint8_t *bytes)
{
    const uint32_t value = (uint32_t)bytes[0] << 16 | (uint16_t)bytes[1] << 8 | bytes[2];
    return (int32_t)(value << 8) >> 8;
}

/* Begin a frame; returns the conversions until now, whose results are in the chip unless it gave them up. */
static uint8_t begin_frame(void)
{
    uint8_t conversions;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        conversions = done;
        latest.time_us = done_us;
        done = 0;
        PORTB &= ~SELECT;
    }
    return conversions;
}

/* The rest of the frame: the oldest result that the chip holds. */
static enum { NOTHING_NEW, DAMAGED, GOOD } finish_frame(void)
{
    uint8_t bytes[CHECKED_BYTES];
    uint16_t crc = CRC_START;
    for (uint8_t i = 0; i < CHECKED_BYTES; i++) {
        bytes[i] = exchange(0);
        crc = _crc_xmodem_update(crc, bytes[i]);
    }
    crc ^= (uint16_t)exchange(0) << 8;
    crc ^= exchange(0);
    exchange(0);
    PORTB |= SELECT;
    latest.table = value_at(bytes + WORD_BYTES);
    latest.relative = value_at(bytes + 2 * WORD_BYTES);
    if (crc != 0) {
        return DAMAGED;
    }
    return (bytes[1] & BOTH_NEW) == BOTH_NEW ? GOOD : NOTHING_NEW;
}

/* The chip holds two results and gives up older ones. So where two or more wait, all are left out and counted:
 * what is read next is then the next conversion.
 */
static uint8_t leave_out(void)
{
    uint8_t conversions = 0;
    for (uint8_t i = 0; i < MOST_WAITING; i++) {
        conversions += begin_frame();
        if (finish_frame() == NOTHING_NEW) {
            break;
        }
    }
    return conversions;
}

bool converter_ready(void)
{
    if (done == 0) {
        return false;
    }
    uint8_t conversions = begin_frame();
    const bool is_good = finish_frame() == GOOD;
    if (conversions > 1 || unsettled > 0) {
        conversions += leave_out();
    } else if (is_good) {
        return true;
    }
    if (unsettled > 0) {
        unsettled -= conversions < unsettled ? conversions : unsettled;
    } else {
        missed += conversions;
    }
    return false;
}

static bool is_saturated(int32_t value)
{
    return value == HIGHEST || value == LOWEST;
}

void converter_read(struct sample *sample)
{
    *sample = latest;
    sample->missed = missed;
    sample->overload = (is_saturated(latest.table) ? OVERLOAD_TABLE : 0) |
                       (is_saturated(latest.relative) ? OVERLOAD_RELATIVE : 0);
    missed = 0;
}
