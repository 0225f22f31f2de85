/* An Arduino Uno in simavr, its serial line on a pseudo-terminal.
 *
 *     board FIRMWARE.hex none|hx711|ads1256|ads131m02[-noisy|-hasty] READINGS.txt|times [bootloader]
 *
 * READINGS.txt has a line "table relative" for each; "times" in its place makes each reading its own time.
 * Writes the name of the pseudo-terminal to stdout, faults to stderr. Follows the wall clock where it can, and
 * waits when nobody reads, so that no byte is lost. SIGUSR1 presses the reset button. Ends when stdin does.
 * With "bootloader" the cause of a reset is erased before the firmware sees it, as an Uno's bootloader does.
 */
#define _GNU_SOURCE
#include "board.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_hex.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#define SLICE_CYCLES (CLOCK_HZ / 4000)
#define BOOTED_CYCLES (CLOCK_HZ / 100)
#define BEHIND_NS 3000000000LL
#define MCUSR 0x54
#define EXTERNAL_RESET 0x02
#define MAX_READINGS 65536
#define COMMAND_BYTES 16
#define ADS131M02 "ads131m02"

static volatile sig_atomic_t is_reset_pressed;
static struct reading readings[MAX_READINGS];
static size_t reading_count;
static uint8_t sent[4096];
static size_t sent_count;

struct reading reading_at(uint64_t index)
{
    return readings[index % reading_count];
}

bool readings_are_times(void)
{
    return reading_count == 0;
}

void fault(const avr_t *avr, const char *what)
{
    fprintf(stderr, "%.6f s: %s\n", (double)avr->cycle / CLOCK_HZ, what);
}

void drive_pin(avr_t *avr, char port, int bit, bool level)
{
    static avr_ioport_external_t outside['D' + 1];
    avr_ioport_external_t *pins = &outside[(int)port];
    pins->name = port;
    pins->mask |= 1u << bit;
    pins->value = level ? pins->value | 1u << bit : pins->value & ~(1u << bit);
    avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL(port), pins);
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(port), bit), level);
}

void watch_pin(avr_t *avr, char port, int bit, avr_irq_notify_t changed, void *param)
{
    avr_irq_t *pin = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(port), bit);
    pin->flags |= IRQ_FLAG_FILTERED;
    avr_irq_register_notify(pin, changed, param);
}

static void die(const char *what)
{
    perror(what);
    exit(1);
}

static void press_reset(int signal)
{
    (void)signal;
    is_reset_pressed = 1;
}

static void read_readings(const char *path)
{
    FILE *file = fopen(path, "r");
    if (file == NULL) {
        die(path);
    }
    struct reading *next = readings;
    while (next < readings + MAX_READINGS && fscanf(file, "%d %d", &next->table, &next->relative) == 2) {
        next++;
    }
    fclose(file);
    reading_count = next - readings;
    if (reading_count == 0) {
        die("no readings");
    }
}

static avr_t *make_board(const char *hex)
{
    uint32_t size, start;
    uint8_t *code = read_ihex_file(hex, &size, &start);
    avr_t *avr = avr_make_mcu_by_name("atmega328p");
    if (code == NULL || avr == NULL) {
        die(hex);
    }
    avr_init(avr);
    avr->frequency = CLOCK_HZ;
    avr_loadcode(avr, code, size, start);
    avr->codeend = start + size;
    free(code);
    return avr;
}

static int make_terminal(void)
{
    const int master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (master < 0 || grantpt(master) < 0 || unlockpt(master) < 0) {
        die("pseudo-terminal");
    }
    const int kept_open = open(ptsname(master), O_RDWR | O_NOCTTY);
    struct termios raw;
    if (kept_open < 0 || tcgetattr(kept_open, &raw) < 0) {
        die("pseudo-terminal");
    }
    cfmakeraw(&raw);
    tcsetattr(kept_open, TCSANOW, &raw);
    return master;
}

static void byte_sent(avr_irq_t *irq, uint32_t byte, void *param)
{
    (void)irq;
    (void)param;
    if (sent_count < sizeof sent) {
        sent[sent_count++] = byte;
    }
}

static void connect_uart(avr_t *avr)
{
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(
        avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), byte_sent, NULL);
}

static bool is_over(void)
{
    struct pollfd in = {.fd = STDIN_FILENO, .events = POLLIN};
    char byte;
    return poll(&in, 1, 0) > 0 && read(STDIN_FILENO, &byte, 1) <= 0;
}

/* All that was sent; waits while the reader has let the pseudo-terminal fill up. */
static void hand_over(int master)
{
    size_t done = 0;
    while (done < sent_count) {
        const ssize_t written = write(master, sent + done, sent_count - done);
        if (written > 0) {
            done += written;
            continue;
        }
        struct pollfd room = {.fd = master, .events = POLLOUT};
        poll(&room, 1, 100);
        if (is_over()) {
            exit(0);
        }
    }
    sent_count = 0;
}

static void take_commands(avr_t *avr, int master)
{
    uint8_t bytes[COMMAND_BYTES];
    const ssize_t count = read(master, bytes, sizeof bytes);
    for (ssize_t i = 0; i < count; i++) {
        avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT), bytes[i]);
    }
}

static int64_t now_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * 1000000000LL + now.tv_nsec;
}

/* Not faster than the wall clock. What a busy machine made late is made up for, within 3 s. */
static void keep_pace(const avr_t *avr)
{
    static int64_t began_ns;
    const int64_t due_ns = began_ns + (int64_t)(avr->cycle * 1e9 / CLOCK_HZ);
    const int64_t early_ns = due_ns - now_ns();
    if (began_ns == 0 || early_ns < -BEHIND_NS) {
        began_ns += now_ns() - due_ns;
    } else if (early_ns > 1000000) {
        nanosleep(&(struct timespec){.tv_nsec = early_ns}, NULL);
    }
}

static void run_slice(avr_t *avr, bool has_bootloader)
{
    const avr_cycle_count_t end = avr->cycle + SLICE_CYCLES;
    while (avr->cycle < end) {
        const int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed) {
            fault(avr, "the processor crashed");
            exit(1);
        }
        if (has_bootloader && avr->pc == avr->reset_pc) {
            avr->data[MCUSR] = 0;
        }
    }
}

static void reset_if_pressed(avr_t *avr)
{
    if (is_reset_pressed) {
        is_reset_pressed = 0;
        avr_reset(avr);
        avr->data[MCUSR] = EXTERNAL_RESET;
    }
}

static void connect_converter(avr_t *avr, const char *name)
{
    if (strcmp(name, "hx711") == 0) {
        connect_hx711_pair(avr);
    } else if (strcmp(name, "ads1256") == 0) {
        connect_ads1256(avr);
    } else if (strncmp(name, ADS131M02, strlen(ADS131M02)) == 0) {
        connect_ads131m02(avr, name + strlen(ADS131M02));
    }
}

int main(int count, char **words)
{
    if (count < 4) {
        fprintf(stderr, "use: board FIRMWARE.hex none|hx711|ads1256|ads131m02[-noisy|-hasty] READINGS.txt|times [bootloader]\n");
        return 2;
    }
    if (strcmp(words[3], "times") != 0) {
        read_readings(words[3]);
    }
    avr_t *avr = make_board(words[1]);
    connect_uart(avr);
    connect_converter(avr, words[2]);
    const bool has_bootloader = count > 4;
    const int master = make_terminal();
    signal(SIGUSR1, press_reset);
    while (avr->cycle < BOOTED_CYCLES) {
        run_slice(avr, has_bootloader);
    }
    printf("%s\n", ptsname(master));
    fflush(stdout);
    while (!is_over()) {
        run_slice(avr, has_bootloader);
        hand_over(master);
        take_commands(avr, master);
        reset_if_pressed(avr);
        keep_pace(avr);
    }
    return 0;
}
