/* Loaded into a program before its C library (LD_PRELOAD), to disturb what that asks of the system.

   DRILL_CLOCK: a file with a number of seconds, which is added to the time of day. The monotonic clocks stay.
   DRILL_SYNC: a path; while it exists, a sync of a file in its folder does not return. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static double offset_s(void)
{
    const char *path = getenv("DRILL_CLOCK");
    char text[64] = "";
    int file = path ? open(path, O_RDONLY | O_CLOEXEC) : -1;
    if (file < 0)
        return 0.0;
    ssize_t length = read(file, text, sizeof text - 1);
    close(file);
    return length > 0 ? atof(text) : 0.0;
}

int clock_gettime(clockid_t clock, struct timespec *now)
{
    int result = (int)syscall(SYS_clock_gettime, clock, now);
    if (result == 0 && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE))
        now->tv_sec += (time_t)offset_s();
    return result;
}

int gettimeofday(struct timeval *now, void *zone)
{
    (void)zone;
    struct timespec read;
    int result = clock_gettime(CLOCK_REALTIME, &read);
    now->tv_sec = read.tv_sec;
    now->tv_usec = read.tv_nsec / 1000;
    return result;
}

time_t time(time_t *stored)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (stored)
        *stored = now.tv_sec;
    return now.tv_sec;
}

static void wait_for_disk(int descriptor)
{
    const char *mark = getenv("DRILL_SYNC");
    char link[64], path[PATH_MAX];
    if (!mark || !strrchr(mark, '/'))
        return;
    snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    ssize_t length = readlink(link, path, sizeof path - 1);
    size_t folder = (size_t)(strrchr(mark, '/') - mark);
    if (length < (ssize_t)folder || strncmp(path, mark, folder) != 0)
        return;
    while (access(mark, F_OK) == 0)
        usleep(20000);
}

int fsync(int descriptor)
{
    wait_for_disk(descriptor);
    return (int)syscall(SYS_fsync, descriptor);
}

int fdatasync(int descriptor)
{
    wait_for_disk(descriptor);
    return (int)syscall(SYS_fdatasync, descriptor);
}
