/* An ADS131M02 on the SPI pins, CS on D10, SYNC/RESET on D9, DRDY on D2, from Texas Instruments' data sheet SBAS853.
 *
 * Each reset begins the file of readings anew, behind the conversions that have not settled, which are STRAY. It
 * holds two conversions, and gives up the older one for a third.
 */
#include <string.h>

#include "board.h"

#define CYCLES_PER_CLOCK (CLOCK_HZ / 2048000.0)
#define RESET_CLOCKS 2048
#define READY_CYCLES (5 * CYCLES_PER_US)        /* t_REGACQ */
#define HIGH_CLOCKS 4                           /* of DRDY before a result that follows one not read */
#define FASTEST_HZ 25000000
#define STRAY 0x5A5A5A
#define BOTH_NEW 0x03
#define UNSETTLED 5
#define HIGHEST 0x7FFFFF
#define WORD_BYTES 3
#define FRAME_BYTES (4 * WORD_BYTES)
#define CHECKED_BYTES 9
#define NOISY_EVERY 40
#define HASTY_EVERY 50
#define HASTY_CYCLES (20 * CYCLES_PER_US)

enum { ID = 0, STATUS = 1, MODE = 2, CLOCK = 3, GAIN1 = 4, REGISTERS = 64 };
enum { NULL_COMMAND = 0x0000, WREG = 0x6000, WREG_MASK = 0xE07F };

static struct {
    uint16_t registers[REGISTERS];
    bool is_noisy, is_hasty, is_selected, is_low, is_in_reset;
    uint8_t in[FRAME_BYTES], out[FRAME_BYTES];
    int place;                          /* of the next byte of the frame */
    uint64_t conversions;               /* since the reset */
    uint32_t held[2][2];                /* the older one first, table and relative */
    int holds;
    uint64_t fetched;
    avr_cycle_count_t reset_began, reset_ended;
} chip;

static unsigned conversion_cycles(void)
{
    const unsigned osr = 128u << (chip.registers[CLOCK] >> 2 & 7);
    return 2 * osr * CYCLES_PER_CLOCK;
}

static void set_ready(avr_t *avr, bool is_low)
{
    chip.is_low = is_low;
    drive_pin(avr, 'D', 2, !is_low);
}

static avr_cycle_count_t fell(avr_t *avr, avr_cycle_count_t when, void *param)
{
    (void)when;
    (void)param;
    set_ready(avr, true);
    return 0;
}

static avr_cycle_count_t converted(avr_t *avr, avr_cycle_count_t when, void *param)
{
    (void)param;
    const uint64_t settled = chip.conversions - UNSETTLED;
    uint32_t *next = chip.held[chip.holds < 2 ? chip.holds : 1];
    if (chip.holds == 2) {
        memcpy(chip.held[0], chip.held[1], sizeof chip.held[0]);
    } else {
        chip.holds++;
    }
    if (chip.conversions++ < UNSETTLED) {
        next[0] = next[1] = STRAY;
    } else if (readings_are_times()) {
        next[0] = next[1] = when / CYCLES_PER_US & HIGHEST;
    } else {
        next[0] = reading_at(settled).table & 0xFFFFFF;
        next[1] = reading_at(settled).relative & 0xFFFFFF;
    }
    if (chip.is_low) {
        set_ready(avr, false);
        avr_cycle_timer_register(avr, HIGH_CLOCKS * CYCLES_PER_CLOCK, fell, &chip);
    } else {
        set_ready(avr, true);
    }
    const bool is_soon = chip.is_hasty && chip.conversions > UNSETTLED && chip.conversions % HASTY_EVERY < 2;
    return when + (is_soon ? HASTY_CYCLES : conversion_cycles());
}

static void begin_conversions(avr_t *avr)
{
    chip.conversions = 0;
    chip.holds = 0;
    avr_cycle_timer_cancel(avr, fell, &chip);
    avr_cycle_timer_cancel(avr, converted, &chip);
    set_ready(avr, false);
    avr_cycle_timer_register(avr, conversion_cycles(), converted, &chip);
}

static void put(int word, uint32_t value)
{
    for (int i = 0; i < 3; i++) {
        chip.out[3 * word + i] = value >> (16 - 8 * i);
    }
}

static uint16_t checksum(const uint8_t *bytes, int count)
{
    uint16_t crc = 0xFFFF;
    for (int i = 0; i < count; i++) {
        crc ^= bytes[i] << 8;
        for (int bit = 0; bit < 8; bit++) {
            crc = crc & 0x8000 ? crc << 1 ^ 0x1021 : crc << 1;
        }
    }
    return crc;
}

static void begin_frame(avr_t *avr)
{
    if (avr->cycle - chip.reset_ended < READY_CYCLES) {
        fault(avr, "ADS131M02: a frame too soon after the reset");
    }
    chip.place = 0;
    put(0, (uint32_t)(chip.registers[STATUS] | (chip.holds > 0 ? BOTH_NEW : 0)) << 8);
    put(1, chip.held[0][0]);
    put(2, chip.held[0][1]);
    put(3, (uint32_t)checksum(chip.out, CHECKED_BYTES) << 8);
    if (chip.is_noisy && ++chip.fetched % NOISY_EVERY == 0) {
        chip.out[5] ^= 0x10;
    }
}

static void take_data(avr_t *avr)
{
    memcpy(chip.held[0], chip.held[1], sizeof chip.held[0]);
    if (chip.holds > 0 && --chip.holds == 0) {
        set_ready(avr, false);
    }
}

static void write_register(avr_t *avr, int address, uint16_t value)
{
    if (address != CLOCK && address != GAIN1) {
        fault(avr, "ADS131M02: a register that the firmware should not need");
        return;
    }
    chip.registers[address] = value;
    if (address == CLOCK) {
        if ((value & 0x0303) != 0x0300) {
            fault(avr, "ADS131M02: not both inputs, or not for a clock of 2.048 MHz");
        }
        begin_conversions(avr);
    }
}

static void end_frame(avr_t *avr)
{
    const uint16_t command = chip.in[0] << 8 | chip.in[1];
    if (chip.place != FRAME_BYTES) {
        fault(avr, "ADS131M02: a frame that is not four words long");
    } else if (command == NULL_COMMAND) {
        return;
    } else if ((command & WREG_MASK) == WREG) {
        write_register(avr, command >> 7 & 0x3F, chip.in[3] << 8 | chip.in[4]);
    } else {
        fault(avr, "ADS131M02: a command that the firmware should not need");
    }
}

static uint8_t answer(avr_t *avr, uint8_t byte)
{
    if (!chip.is_selected) {
        return 0xFF;
    }
    if (chip.is_in_reset || chip.place == FRAME_BYTES) {
        fault(avr, "ADS131M02: a byte while it is reset, or after a frame");
        return 0;
    }
    chip.in[chip.place] = byte;
    if (chip.place == WORD_BYTES - 1 && (chip.in[0] << 8 | chip.in[1]) == NULL_COMMAND) {
        take_data(avr);
    }
    return chip.out[chip.place++];
}

static void select_changed(avr_irq_t *irq, uint32_t level, void *param)
{
    (void)irq;
    if (!level) {
        begin_frame(param);
    } else if (chip.is_selected) {
        end_frame(param);
    }
    chip.is_selected = !level;
}

static void reset(avr_t *avr)
{
    memset(chip.registers, 0, sizeof chip.registers);
    chip.registers[STATUS] = 0x0500;
    chip.registers[MODE] = 0x0510;
    chip.registers[CLOCK] = 0x030E;
    begin_conversions(avr);
}

static void reset_changed(avr_irq_t *irq, uint32_t level, void *param)
{
    avr_t *avr = param;
    (void)irq;
    if (level && chip.is_in_reset) {
        if (avr->cycle - chip.reset_began < RESET_CLOCKS * CYCLES_PER_CLOCK) {
            fault(avr, "ADS131M02: the reset is too short");
        }
        chip.reset_ended = avr->cycle;
        reset(avr);
    }
    if (!level) {
        chip.reset_began = avr->cycle;
    }
    chip.is_in_reset = !level;
}

void connect_ads131m02(avr_t *avr, const char *fault)
{
    chip.is_noisy = strcmp(fault, "-noisy") == 0;
    chip.is_hasty = strcmp(fault, "-hasty") == 0;
    connect_spi(avr, FASTEST_HZ, answer);
    watch_pin(avr, 'B', 2, select_changed, avr);
    watch_pin(avr, 'B', 1, reset_changed, avr);
    reset(avr);
}
