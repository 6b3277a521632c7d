/* A GenTL producer whose camera stamps its pictures: all but two functions are those of the producer
 * that it is linked to. Compiled with TICKS_HZ and, for a camera that tells nanoseconds too, WITH_NS.
 * Stamps count from the start of the machine and are whole milliseconds, unlike times of arrival.
 */
#include <dlfcn.h>
#include <stddef.h>
#include <stdint.h>
#include <time.h>

enum { TIMESTAMP = 3, TIMESTAMP_NS = 28, TIMESTAMP_FREQUENCY = 9, TYPE_UINT64 = 8, NOT_IMPLEMENTED = -1003 };

typedef int32_t (*GetInfo)(void *, void *, int32_t, int32_t *, void *, size_t *);
typedef int32_t (*GetDeviceInfo)(void *, int32_t, int32_t *, void *, size_t *);

static int32_t answer(uint64_t value, int32_t *type, void *buffer, size_t *size) {
    if (type) *type = TYPE_UINT64;
    if (buffer) *(uint64_t *)buffer = value;
    *size = sizeof value;
    return 0;
}

static uint64_t now_ms(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * 1000 + (uint64_t)t.tv_nsec / 1000000;
}

int32_t DSGetBufferInfo(void *stream, void *buffer, int32_t command, int32_t *type, void *found, size_t *size) {
    if (command == TIMESTAMP) return answer(now_ms() * (TICKS_HZ / 1000), type, found, size);
#ifdef WITH_NS
    if (command == TIMESTAMP_NS) return answer(now_ms() * 1000000, type, found, size);
#else
    if (command == TIMESTAMP_NS) return NOT_IMPLEMENTED;
#endif
    return ((GetInfo)dlsym(RTLD_NEXT, "DSGetBufferInfo"))(stream, buffer, command, type, found, size);
}

int32_t DevGetInfo(void *device, int32_t command, int32_t *type, void *found, size_t *size) {
    if (command == TIMESTAMP_FREQUENCY) return answer(TICKS_HZ, type, found, size);
    return ((GetDeviceInfo)dlsym(RTLD_NEXT, "DevGetInfo"))(device, command, type, found, size);
}
