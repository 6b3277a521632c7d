/* A failing disk and a stepping clock for one process, by LD_PRELOAD.
 *
 * The file named by SEAMLOG_FAULTS holds sixteen int64, changed by the test while the process runs:
 * see tests/faults/shim.py for their meaning. Only files whose name holds ".mcap" are touched.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

enum { WRITE_ERRNO, WRITE_TIMES, WRITE_DELAY_US, SHORT_BYTES, SYNC_ERRNO, SYNC_TIMES, SYNC_DELAY_US,
       CLOCK_OFFSET_NS, WRITES, SYNCS, FAILED_SYNCS };

static _Atomic int64_t *words;
static ssize_t (*real_writev)(int, const struct iovec *, int);
static ssize_t (*real_write)(int, const void *, size_t);
static int (*real_fsync)(int), (*real_fdatasync)(int);
static int (*real_clock_gettime)(clockid_t, struct timespec *);

__attribute__((constructor)) static void begin(void)
{
    real_writev = dlsym(RTLD_NEXT, "writev");
    real_write = dlsym(RTLD_NEXT, "write");
    real_fsync = dlsym(RTLD_NEXT, "fsync");
    real_fdatasync = dlsym(RTLD_NEXT, "fdatasync");
    real_clock_gettime = dlsym(RTLD_NEXT, "clock_gettime");
    const char *path = getenv("SEAMLOG_FAULTS");
    int file = path ? open(path, O_RDWR | O_CLOEXEC) : -1;
    if (file < 0)
        return;
    void *mapped = mmap(NULL, 128, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    close(file);
    if (mapped != MAP_FAILED)
        words = mapped;
}

static int is_session(int file)
{
    char link[64], name[1024];
    if (!words)
        return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    ssize_t size = readlink(link, name, sizeof name - 1);
    if (size <= 0)
        return 0;
    name[size] = 0;
    return strstr(name, ".mcap") != NULL;
}

static void delay(int which)
{
    int64_t us = words[which];
    struct timespec rest = { us / 1000000, us % 1000000 * 1000 };
    if (us > 0)
        nanosleep(&rest, NULL);
}

/* TIMES: how often the error comes, -1 for ever. */
static int fails(int number, int times)
{
    if (!words[number] || !words[times])
        return 0;
    if (words[times] > 0)
        words[times]--;
    errno = (int)words[number];
    return 1;
}

static ssize_t shortened(int file, const struct iovec *parts, int count)
{
    size_t left = (size_t)words[SHORT_BYTES];
    for (int i = 0; i < count; i++)
        if (parts[i].iov_len)
            return real_write(file, parts[i].iov_base, parts[i].iov_len < left ? parts[i].iov_len : left);
    return 0;
}

ssize_t writev(int file, const struct iovec *parts, int count)
{
    if (!is_session(file))
        return real_writev(file, parts, count);
    words[WRITES]++;
    delay(WRITE_DELAY_US);
    if (words[WRITE_ERRNO] && words[WRITE_TIMES])
        shortened(file, parts, count); /* what fails leaves something behind */
    if (fails(WRITE_ERRNO, WRITE_TIMES))
        return -1;
    return words[SHORT_BYTES] ? shortened(file, parts, count) : real_writev(file, parts, count);
}

ssize_t write(int file, const void *data, size_t size)
{
    struct iovec part = { (void *)data, size };
    return is_session(file) ? writev(file, &part, 1) : real_write(file, data, size);
}

static int synced(int file, int (*real)(int))
{
    if (!is_session(file))
        return real(file);
    words[SYNCS]++;
    delay(SYNC_DELAY_US);
    if (fails(SYNC_ERRNO, SYNC_TIMES)) {
        words[FAILED_SYNCS]++;
        return -1;
    }
    return real(file);
}

int fsync(int file) { return synced(file, real_fsync); }
int fdatasync(int file) { return synced(file, real_fdatasync); }

int clock_gettime(clockid_t clock, struct timespec *now)
{
    int fault = real_clock_gettime(clock, now);
    if (!fault && clock == CLOCK_REALTIME && words) {
        int64_t ns = now->tv_sec * INT64_C(1000000000) + now->tv_nsec + words[CLOCK_OFFSET_NS];
        now->tv_sec = ns / 1000000000;
        now->tv_nsec = ns % 1000000000;
    }
    return fault;
}
