/* An ADS1256 on the SPI pins, CS on D10 and DRDY on D9, from Texas Instruments' data sheet SBAS288K.
 *
 * Each self-calibration begins the file of readings anew. Only the first result after a SYNC is a reading;
 * those that follow by themselves, at times the firmware does not know, are STRAY.
 */
#include <string.h>

#include "board.h"

#define NS_PER_CYCLE 62.5
#define TAU_NS 130.208                  /* one clock of 7.68 MHz */
#define T6_CYCLES (50 * TAU_NS / NS_PER_CYCLE)
#define T11_SYNC_CYCLES (24 * TAU_NS / NS_PER_CYCLE)
#define FASTEST_HZ (7680000 / 4)
#define CALIBRATION_US 9000
#define STRAY 0x5A5A5A
#define HIGHEST 0x7FFFFF

enum { MUX = 1, ADCON = 2, DRATE = 3, REGISTERS = 11 };
enum { WAKEUP = 0x00, RDATA = 0x01, WREG = 0x50, SELFCAL = 0xF0, SYNC = 0xFC, WAKEUP_TOO = 0xFF };

static const struct {
    uint8_t drate;
    uint32_t settling_us;
    uint32_t period_us;
} speeds[] = {
    {0xF0, 210, 33}, {0xE0, 250, 67}, {0xD0, 310, 133}, {0xC0, 440, 267},
    {0xB0, 680, 500}, {0xA1, 1180, 1000}, {0x92, 2180, 2000}, {0x82, 10180, 10000},
};

static struct {
    uint8_t registers[REGISTERS];
    uint8_t command;                    /* that waits for its bytes; 0 none */
    int argument;                       /* which of them comes next */
    int write_count;
    bool is_selected, is_calibrating, is_stopped, is_ready;
    uint32_t value;
    uint64_t readings[2];               /* taken since the calibration, table and relative */
    avr_cycle_count_t woken;
} chip;

static void set_ready(avr_t *avr, bool is_ready)
{
    chip.is_ready = is_ready;
    drive_pin(avr, 'B', 1, !is_ready);
}

static unsigned speed(avr_t *avr)
{
    for (unsigned i = 0; i < sizeof speeds / sizeof speeds[0]; i++) {
        if (speeds[i].drate == chip.registers[DRATE]) {
            return i;
        }
    }
    fault(avr, "ADS1256: DRATE is none of its rates");
    return 0;
}

static uint32_t next_reading(avr_t *avr)
{
    if (readings_are_times()) {
        return chip.woken / CYCLES_PER_US & HIGHEST;
    }
    switch (chip.registers[MUX]) {
    case 0x01:
        return reading_at(chip.readings[0]++).table & 0xFFFFFF;
    case 0x23:
        return reading_at(chip.readings[1]++).relative & 0xFFFFFF;
    default:
        fault(avr, "ADS1256: no gauge is on the input that MUX selects");
        return STRAY;
    }
}

static avr_cycle_count_t converted_again(avr_t *avr, avr_cycle_count_t when, void *param)
{
    (void)param;
    chip.value = STRAY;
    set_ready(avr, true);
    return when + speeds[speed(avr)].period_us * CYCLES_PER_US;
}

static avr_cycle_count_t settled(avr_t *avr, avr_cycle_count_t when, void *param)
{
    (void)when;
    (void)param;
    chip.value = next_reading(avr);
    set_ready(avr, true);
    avr_cycle_timer_register(avr, speeds[speed(avr)].period_us * CYCLES_PER_US, converted_again, &chip);
    return 0;
}

static avr_cycle_count_t calibrated(avr_t *avr, avr_cycle_count_t when, void *param)
{
    (void)when;
    (void)param;
    chip.is_calibrating = false;
    memset(chip.readings, 0, sizeof chip.readings);
    chip.value = STRAY;
    set_ready(avr, true);
    return 0;
}

static void stop_converting(avr_t *avr)
{
    avr_cycle_timer_cancel(avr, settled, &chip);
    avr_cycle_timer_cancel(avr, converted_again, &chip);
    set_ready(avr, false);
}

static void calibrate(avr_t *avr)
{
    if (chip.registers[ADCON] != 0x06) {
        fault(avr, "ADS1256: the gain is not 64");
    }
    stop_converting(avr);
    chip.is_calibrating = true;
    avr_cycle_timer_register_usec(avr, CALIBRATION_US, calibrated, &chip);
}

static void wake_up(avr_t *avr)
{
    if (chip.is_stopped && spi_times.byte_began - spi_times.byte_ended < T11_SYNC_CYCLES) {
        fault(avr, "ADS1256: t11 after SYNC is too short");
    }
    chip.is_stopped = false;
    chip.woken = avr->cycle;
    avr_cycle_timer_register_usec(avr, speeds[speed(avr)].settling_us, settled, &chip);
}

static void begin_command(avr_t *avr, uint8_t byte)
{
    chip.argument = 0;
    if (chip.is_calibrating) {
        fault(avr, "ADS1256: a command during calibration");
    }
    if (byte == SELFCAL) {
        calibrate(avr);
    } else if (byte == SYNC) {
        stop_converting(avr);
        chip.is_stopped = true;
    } else if (byte == WAKEUP || byte == WAKEUP_TOO) {
        wake_up(avr);
    } else if (byte == RDATA || (byte & 0xF0) == WREG) {
        chip.command = byte;
    } else {
        fault(avr, "ADS1256: a command that the firmware should not need");
    }
}

static void write_register(avr_t *avr, uint8_t byte)
{
    const int place = (chip.command & 0x0F) + chip.argument - 1;
    if (chip.argument++ == 0) {
        chip.write_count = byte + 1;
        return;
    }
    if (place >= REGISTERS) {
        fault(avr, "ADS1256: no such register");
    } else {
        chip.registers[place] = byte;
    }
    if (chip.argument > chip.write_count) {
        chip.command = 0;
    }
}

static uint8_t read_data(avr_t *avr)
{
    if (chip.argument == 0 && spi_times.byte_began - spi_times.byte_ended < T6_CYCLES) {
        fault(avr, "ADS1256: t6 after RDATA is too short");
    }
    if (chip.argument == 0 && !chip.is_ready) {
        fault(avr, "ADS1256: read before it was ready");
    }
    const uint8_t byte = chip.value >> (16 - 8 * chip.argument++);
    if (chip.argument == 3) {
        chip.command = 0;
        set_ready(avr, false);
    }
    return byte;
}

static uint8_t answer(avr_t *avr, uint8_t byte)
{
    if (!chip.is_selected) {
        return 0xFF;
    }
    if (chip.command == RDATA) {
        return read_data(avr);
    }
    if (chip.command != 0) {
        write_register(avr, byte);
    } else {
        begin_command(avr, byte);
    }
    return 0;
}

static void select_changed(avr_irq_t *irq, uint32_t level, void *param)
{
    (void)irq;
    (void)param;
    chip.is_selected = !level;
    chip.command = 0;
}

void connect_ads1256(avr_t *avr)
{
    connect_spi(avr, FASTEST_HZ, answer);
    watch_pin(avr, 'B', 2, select_changed, NULL);
    set_ready(avr, true);
}
